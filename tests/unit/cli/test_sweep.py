"""`raccoon sweep`: from the arguments to the words."""

import argparse
import json
import re
import shlex
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from raccoon.cli.main import main
from raccoon.cli.sweep import configure, report
from raccoon.cli.sweep.play import _factors
from raccoon.core.config import RobotConfig
from raccoon.sweep.execute import Crew
from raccoon.sweep.factors import parse_factor
from raccoon.sweep.match import Match
from raccoon.sweep.program import Program
from raccoon.sweep.results import read_results
from raccoon.sweep.summary import summary
from raccoon.sweep.workers import process_crew
from sweep_work import PROGRAM

VARIED = ["--only-varied", "--vary", "battery.open_circuit_voltage=5:8"]


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "robot.toml").write_text("", encoding="utf-8")
    (tmp_path / "drive.py").write_text(PROGRAM, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return "drive.py"


def test_from_processes_to_a_table_and_a_rate(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["sweep", program, *VARIED, "--runs", "20", "--out", "r.csv", "--within", "0.005"]
    assert main([*arguments, "--workers", "1"]) == 0
    said = capsys.readouterr()
    rows = read_results("r.csv")
    failed = sum(row["status"] == "failed" for row in rows)
    assert f"drive.py: {failed} of 20 matches failed (seed 0)." in said.out
    assert "95 % interval" in said.out
    assert "1. battery.open_circuit_voltage.voltage" in said.out
    assert "20/20 matches" in said.err
    assert json.loads(Path("r.csv.sweep.json").read_text())["program"] == program

    assert main(arguments) == 0  # all is there: nothing is played
    again = capsys.readouterr()
    assert again.out == said.out
    assert again.err == ""

    assert main(["sweep", program, *VARIED, "--only", "7", "--record", "run.jsonl.gz"]) == 0
    assert f"{rows[7]['x']:.6g}" in capsys.readouterr().out


def test_the_command_that_shows_a_failure_can_be_copied(
    program: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = nullcontext(Crew(ThreadPoolExecutor(1), 1))
    monkeypatch.setattr("raccoon.sweep.workers.process_crew", lambda _: alone)
    Path("a robot.toml").write_text("", encoding="utf-8")
    Path("a table.toml").write_text('name = "bare"\n', encoding="utf-8")
    sweep = ["sweep", program, *VARIED, "--robot", "a robot.toml", "--within", "1e-9", "--out", "r.csv"]
    sweep += ["--table", "a table.toml"]
    assert main([*sweep, "--runs", "1", "--seed", "4", "--workers", "1"]) == 0
    found = re.search(r"see one: raccoon (.*)\n +raccoon (.*)\n", capsys.readouterr().out)
    assert found is not None
    play, view = (shlex.split(each) for each in found.groups())
    assert main(play) == 0
    said = capsys.readouterr().out
    failed = next(row for row in read_results("r.csv") if row["status"] == "failed")
    assert f"{failed['position_error']:.6g}" in said
    assert said.endswith(f"recorded: run-{failed['run']}.jsonl.gz\n")
    assert view[1:] == ["run-0.jsonl.gz", "--table", "a table.toml"]
    assert main(view) == 0


def test_a_recording_that_is_there_is_refused_before_the_match(
    program: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    only = ["sweep", program, *VARIED, "--any-end", "--only", "7", "--record"]
    assert main([*only, "run.jsonl"]) == 0
    assert capsys.readouterr().out.endswith("recorded: run.jsonl.gz\n")
    before = Path("run.jsonl.gz").read_bytes()

    def played(*_: object) -> None:
        raise AssertionError("the match was played")

    monkeypatch.setattr("raccoon.cli.sweep.play.play", played)
    for name in ("run.jsonl.gz", "run.jsonl", "run"):
        assert main([*only, name]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err == ("raccoon sweep: --record run.jsonl.gz: it already exists; choose another name\n")
    assert Path("run.jsonl.gz").read_bytes() == before
    assert not list(Path().glob("run-*"))


def test_nothing_is_said_to_be_recorded_that_is_not(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(program).write_text("mission = 3 +", encoding="utf-8")
    assert main(["sweep", program, *VARIED, "--any-end", "--only", "7", "--record", "run"]) == 2
    said = capsys.readouterr()
    assert "SyntaxError" in said.out
    assert "recorded" not in said.out
    assert said.err == "raccoon sweep: --record run: nothing was recorded\n"


def test_what_an_interrupted_sweep_has_played_is_named(
    program: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("raccoon.cli.sweep.play.sweep", interrupted)
    assert main(["sweep", program, "--any-end", "--out", "r.csv"]) == 130
    assert capsys.readouterr().err == "raccoon sweep: interrupted\n"  # there is no file yet
    Path("r.csv").touch()
    assert main(["sweep", program, "--any-end", "--out", "r.csv"]) == 130
    assert capsys.readouterr().err == (
        "what was played is in r.csv: the same command continues from there\nraccoon sweep: interrupted\n"
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["drive.py", "--record", "run"], "say which with --only RUN"),
        (["drive.py", "--only", "-1"], "--only -1: the sweep has 200 matches (--runs)"),
        (
            ["drive.py", "--only", "99", "--runs", "6"],
            "--only 99: the sweep has 6 matches (--runs), number 0 to 5",
        ),
        (["drive.py", "--vary", "foo=1:2"], "there is no such id"),
        (["drive.py", "--only", "1", "--record", "robot.toml/run"], "nothing can be written in"),
        (["drive.py", "--only", "1", "--record", "."], "--record .: it is a folder"),
        (["drive.py", "--seed", "-1"], "--seed -1: allowed are whole numbers from 0"),
        (["drive.py", "--start", "0", "inf", "0"], "--start 0 inf 0: allowed are X and Y"),
        (["drive.py", "--faults", "nan"], "--faults nan"),
        (["drive.py", "--within-angle", "-1"], "--within-angle -1: "),
        (["drive.py", "--out", "nowhere/r.csv"], "there is no folder nowhere"),
        (["nowhere.py"], "nowhere.py: there is no such program\n"),
        (["robot.toml"], "robot.toml: a program is a Python file, whose name ends in .py\n"),
        (["drive.py", "--only-varied"], "nothing is varied"),
        (["drive.py", "--vary", "drive.wheel=2"], "there is no such id"),
        (["drive.py", "--faults", "3"], "--faults 3: allowed are numbers from 0 to 1"),
        (["drive.py", "--runs", "0"], "runs is 0"),
        (["drive.py", "--workers", "-1"], "--workers -1: allowed are whole numbers from 0"),
        (["drive.py", "--out", "r.txt"], "endings .csv and .parquet"),
        (["drive.py", "--scheduler", "tcp://x:1"], "--executor dask"),
        (["drive.py", "--within", "0"], "--within 0: "),
        (["drive.py", "--any-end", "--within", "0.1"], "--within 0.1: with --any-end no end counts"),
        (["drive.py", "--any-end", "--within-angle", "5"], "--within-angle 5: with --any-end no end counts"),
        (
            ["drive.py", "--within", "30"],
            "--within 30: allowed are numbers above 0 up to 1 (m; 3 cm are 0",
        ),
        (
            ["drive.py", "--within-angle", "360"],
            "--within-angle 360: allowed are numbers above 0 up to 1",
        ),
        (
            ["drive.py", "--start", "5", "0", "90"],
            "start is x 5 m, y 0 m, 90 deg: it is off the table botball",
        ),
        (["drive.py", "--table", "none.toml"], "none.toml"),
        (["drive.py", "--robot", "none.toml"], "none.toml"),
    ],
)
@pytest.mark.usefixtures("program")
def test_bad_input_is_named(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before a worker begins: runs of 0 were refused once the nominal robot had driven."""

    def begun(*_: object) -> None:
        raise AssertionError("a worker was begun")

    monkeypatch.setattr("raccoon.cli.sweep.play.open_crew", begun)
    assert main(["sweep", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_an_error_is_said_once_with_its_match(capsys: pytest.CaptureFixture[str]) -> None:
    """200 x ConfigError said nothing of what to mend."""
    row = {"battery.open_circuit_voltage.voltage": 6.6, "position_error": 0.01, "status": "failed"}
    reasons = ["", "ended more than 0.05 m off", "ConfigError: no tophat 'front': name one", "ConfigError: b"]
    rows = [{**row, "run": run, "reason": reason} for run, reason in enumerate(reasons)]
    rows[0]["status"] = "ok"
    match = Match(Program("drive.py", PROGRAM, "."), RobotConfig(), (parse_factor(VARIED[2]),))
    report.print_report(match, rows, 0, ["sweep", "drive.py"], None)
    said = capsys.readouterr().out
    assert " 2 x ConfigError, as match 2: no tophat 'front': name one\n" in said
    assert " 1 x ended more than 0.05 m off\n" in said


def test_each_worker_has_its_next_match_at_hand() -> None:
    with process_crew(1) as crew:
        assert crew.window == 2


@pytest.mark.parametrize(
    ("given", "left"),
    [
        ("motor.back_emf_constant@0=1~0.1", ["motor.back_emf_constant.factor@right"]),
        ("motor.back_emf_constant=1~0.1", []),
    ],
)
def test_what_is_given_takes_the_place_of_what_varies_by_default(given: str, left: list[str]) -> None:
    parser = argparse.ArgumentParser()
    configure(parser)
    args = parser.parse_args(["program.py", "--vary", given])
    names = [
        each.name for each in _factors(args, RobotConfig(), None) if each.effect == "motor.back_emf_constant"
    ]
    assert names == [*left, parse_factor(given).name]


def test_a_few_matches_name_only_what_is_more_than_chance(capsys: pytest.CaptureFixture[str]) -> None:
    """Of six matches any parameter explained 99 %, in three lines that said so."""
    random = np.random.default_rng(3)
    draws = random.uniform(size=(6, 12))
    rows = [
        {
            "status": "ok",
            "reason": "",
            "position_error": float(random.uniform()),
            **{str(n): float(x) for n, x in enumerate(each)},
        }
        for each in draws
    ]
    found = summary(rows, [str(n) for n in range(12)])
    assert found.sensitivities
    assert not any(each.is_clear for each in found.sensitivities)
    report._print_sensitivities(found, {})
    assert "Nothing can be said about what it depends on: too few matches" in capsys.readouterr().out


def test_the_robot_of_a_model_plays_while_the_program_goes_by_robot_toml(
    program: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("model.toml").write_text(
        '[[effect]]\nid = "drive.wheel_radius"\nparameters = { factor = 1.05 }\nstd = { factor = 0.001 }\n',
        encoding="utf-8",
    )
    Path(program).write_text("from raccoon import straight\nmission = straight(0.2)\n", encoding="utf-8")
    errors = []
    for model in ([], ["--model", "model.toml"]):
        assert main(["sweep", program, *VARIED, *model, "--only", "0"]) == 0
        errors.append(float(capsys.readouterr().out.split("position_error")[1].split()[0]))
    straight, wrong = errors
    assert wrong == pytest.approx(0.05 * 0.2, rel=0.2)
    assert straight < 0.002
    assert main(["sweep", program, "--robot", "model.toml"]) == 2
    assert "--model of diagnose, excite and sweep takes" in capsys.readouterr().err
