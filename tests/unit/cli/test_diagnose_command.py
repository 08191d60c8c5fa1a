"""`raccoon diagnose` from the command line, mostly on files that it must refuse or survive."""

from __future__ import annotations

import io
import json
import os
import re
import sys
import tomllib
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

import raccoon
from blind.generator import make
from blind.tophats import tophat
from csv_files import write_csv_file
from raccoon.cli.diagnose.files import recordings
from raccoon.cli.diagnose.known_values import without_known_values
from raccoon.cli.main import main
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.diagnose.reports.cause_text import describe_cause, explanation_sentence
from raccoon.diagnose.reports.html import load_template
from raccoon.diagnose.result import CauseResult, Diagnosis, Gain, ParameterResult, Unexplained, Verdict
from raccoon.sim.effects.model_file import save_model
from raccoon.sim.effects.parameters import Parameters
from unit.diagnose.axes import motor

Columns = dict[str, np.ndarray]
EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def drive() -> Columns:
    return dict(make(4, seconds=6.0).columns)


def dark(seed: int) -> Columns:
    """A tophat that reads a tenth less: of all recordings the one that is diagnosed in least time."""
    return dict(tophat(seed, factor=0.9, seconds=4.0))


def test_one_motor_with_json_and_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_csv_file(tmp_path / "motor.csv", motor(5, 0.008))
    out, page, model = (tmp_path / each for each in ("out.json", "out.html", "model.toml"))
    command = ["diagnose", str(path), "--json", str(out), "--html", str(page), "--save-model", str(model)]
    assert main(command) == 0
    assert json.loads(out.read_text())["causes"][0]["id"] == "friction.coulomb"
    assert "Dry friction" in page.read_text()
    said = capsys.readouterr().out
    assert "Dry friction of 0.00" in said
    assert "not written" in said
    assert not model.exists()


@pytest.mark.parametrize("asked", [["--executor", "dask"], ["--workers", "3"], []], ids=str)
def test_workers_that_one_recording_leaves_idle_are_told_of(
    asked: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_csv_file(tmp_path / "dark.csv", dark(1))
    assert main(["diagnose", str(path), *asked]) == 0
    told = capsys.readouterr().err
    said = f"{' '.join(asked)}: not used: a single diagnosis runs in this process\n"
    assert told == (said if asked else "")


@pytest.mark.usefixtures("few_causes")
def test_the_model_says_what_it_was_made_from(
    drive: Columns, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, model, out = (
        write_csv_file(tmp_path / "run.csv", drive),
        tmp_path / "model.toml",
        tmp_path / "out.json",
    )
    save_model(Parameters.from_robot(RobotConfig()), model)  # a model replaces a model
    assert main(["diagnose", str(path), "--save-model", str(model), "--json", str(out)]) == 0
    table = tomllib.loads(model.read_text())
    assert table["provenance"]["recording"] == "run.csv"
    assert table["provenance"]["by"] == f"raccoon diagnose {raccoon.__version__}"
    assert table["provenance"]["verdict"] == json.loads(out.read_text())["verdict"]
    assert date.fromisoformat(table["provenance"]["date"])
    assert all(each["std"].keys() <= each["parameters"].keys() and each["std"] for each in table["effect"])
    assert main(["diagnose", str(path), "--model", str(model)]) == 0
    assert "looking" not in capsys.readouterr().err  # what it is doing is said at a terminal only


def test_a_model_leaves_wiring_and_sensors_to_robot_toml(tmp_path: Path) -> None:
    """A tophat that robot.toml got after the model was written was not known."""
    columns = tophat(3, held=True, seconds=4.0, factor=0.9)
    path = write_csv_file(tmp_path / "run.csv", {**columns, "analog.5": columns["analog.2"]})
    model, robot, out = (tmp_path / each for each in ("model.toml", "robot.toml", "out.json"))
    of_one = Parameters.from_robot(parse_robot({"tophat": {"front": {"analog": 2}}}))
    save_model(of_one.with_effect("tophat.gain", "2", factor=0.9), model)
    robot.write_text('name = "drumbot"\n[tophat.back]\nanalog = 5\n')
    command = ["diagnose", str(path), "--model", str(model), "--json", str(out)]
    assert main([*command, "--robot", str(robot), "--save-model", str(tmp_path / "new.toml")]) == 0
    found = json.loads(out.read_text())
    assert [each["name"] for each in found["channels"]] == ["analog.5", "analog.2"]
    assert [(each["id"], each["where"]) for each in found["causes"]] == [("tophat.gain", "5")]
    assert tomllib.loads((tmp_path / "new.toml").read_text())["name"] == "drumbot"


def test_what_changes_nothing_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, own = write_csv_file(tmp_path / "motor.csv", motor(5, 0.008)), EXAMPLES / "own_causes.py"
    save_model(Parameters(), tmp_path / "model.toml")
    unused = ["--causes", str(own), "--truth-free", "--model", str(tmp_path / "model.toml")]
    assert main(["diagnose", str(path), *unused]) == 0
    said = capsys.readouterr().out
    assert "Note: the effects of --model were not used" in said
    assert "Note: the effects of --causes were not considered" in said
    assert "Note: --truth-free left nothing out" in said
    assert main(["diagnose", str(write_csv_file(tmp_path / "dark.csv", dark(5)))]) == 0
    assert "Note: the effects" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("id_", "key", "value", "nominal", "other"),
    [
        ("friction.coulomb", "coulomb", 0.18, 0.25, 0.25),
        ("friction.coulomb", "coulomb", 0.18, 0.1, 0.1),
        ("battery.open_circuit_voltage", "open_circuit_voltage", 6.4, 6.8, 6.8),
        ("battery.internal_resistance", "internal_resistance", 0.16, 0.05, 0.05),
    ],
)
def test_a_number_that_robot_toml_has_is_not_to_be_put_there(
    id_: str, key: str, value: float, nominal: float, other: float
) -> None:
    """The model.toml that the diagnosis began from is older. The page has what to do apart, as of any cause:
    it had the whole sentence as its headline."""
    numbers = {"number": ParameterResult(value + 0.001, 0.002, "", nominal)}
    said = f"{explanation_sentence(id_, None, numbers)} More of it."
    cause = CauseResult(id_, None, 1, numbers, Gain(2.0, 1.0, 0.5), 1.0, (), said)
    found = Diagnosis(Verdict.EXPLAINED, (), (cause,), (), Unexplained(0.0), (), 0.1)
    group = id_.partition(".")[0]
    has, has_not = (parse_robot({"model": {group: {key: each}}}) for each in (value, other))
    assert without_known_values(found, has_not) == found
    (known,) = without_known_values(found, has).causes
    assert known.explanation.endswith("(--save-model writes a new one). More of it.")
    assert describe_cause(known).what == describe_cause(cause).what
    assert describe_cause(known).todo.startswith(
        f"robot.toml has {key} = {value:g} in [model.{group}] already; "
    )
    one_wheel = replace(found, causes=(replace(cause, where="left"),))
    assert without_known_values(one_wheel, has) == one_wheel


class ClosedPipe(io.StringIO):
    """What `| head` leaves a command to print to."""

    def write(self, _text: str) -> int:
        raise BrokenPipeError


@pytest.mark.parametrize("count", [1, 2])
def test_a_closed_pipe_costs_no_file(count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [write_csv_file(tmp_path / f"run-{seed}.csv", dark(5 + seed)) for seed in range(count)]
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    monkeypatch.setattr(sys, "stdout", ClosedPipe())
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert main(["diagnose", *map(str, paths), "--json", str(out), "--html", str(page)]) == 141
    assert "tophat.gain" in out.read_text()
    assert ("tophat.gain" if count > 1 else "reads 10 % less") in page.read_text()


def test_what_was_found_is_said_where_the_page_cannot_be_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_csv_file(tmp_path / "run.csv", dark(5))
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    monkeypatch.setitem(sys.modules, "jinja2", None)
    load_template.cache_clear()  # of other tests
    assert main(["diagnose", str(path), "--json", str(out), "--html", str(page)]) == 2
    said = capsys.readouterr()
    assert "Tophat 2 reads 10 % less" in said.out
    assert "jinja2" in said.err
    assert out.exists()
    assert not page.exists()


@pytest.mark.parametrize("option", ["--json", "--html", "--save-model"])
def test_a_file_that_cannot_be_written_is_said_before_the_work(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "missing" / "out"
    assert main(["diagnose", str(tmp_path / "never-read.csv"), option, str(missing)]) == 2
    assert f"{missing}: there is no folder" in capsys.readouterr().err
    assert main(["diagnose", str(tmp_path / "never-read.csv"), option, str(tmp_path)]) == 2
    assert "it is a folder" in capsys.readouterr().err


def test_a_bad_file_that_comes_first_stops_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text("")
    write_csv_file(tmp_path / "run.csv", dark(5))
    assert main(["diagnose", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert re.search(r"^a\.csv: no diagnosis: (?!a\.csv)", said.out, re.MULTILINE)
    assert "run.csv: " in said.out
    assert said.err.splitlines()[-1].startswith("2/2 recordings, 1 failed, 0:00 left")


def test_runs_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number in (1, 10, 2):
        (tmp_path / f"run{number}.csv").write_text("")
    names = ["run1.csv", "run2.csv", "run10.csv"]
    assert [each.name for each in recordings([tmp_path])] == names
    assert [each.name for each in recordings(sorted(tmp_path.iterdir()))] == names  # as a shell gives them
    mine = [tmp_path / each for each in ("run10.csv", "run1.csv", "run2.csv")]
    assert recordings(mine) == mine


@pytest.mark.parametrize("option", ["--json", "--html", "--save-model"])
def test_what_is_read_is_not_overwritten(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, link, robot = tmp_path / "run.csv", tmp_path / "link.csv", tmp_path / "robot.toml"
    path.write_text("t\n0\n")
    robot.write_text("")
    link.symlink_to(path)
    for out in (path, link, robot):
        assert main(["diagnose", str(path), "--robot", str(robot), option, str(out)]) == 2
        assert f"{out}: this command reads it" in capsys.readouterr().err
    assert main(["diagnose", str(path), "--holdout", str(link), option, str(link)]) == 2
    assert path.read_text() == "t\n0\n"


@pytest.mark.parametrize("option", ["--json", "--html", "--save-model"])
def test_a_result_replaces_no_work(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_csv_file(tmp_path / "run.csv", {"t": np.zeros(1)})
    for name in ("robot.toml", "other.csv", "program.py", "other.jsonl.gz"):
        work = tmp_path / name
        work.write_text("name = 'ours'\n")
        assert main(["diagnose", str(path), option, str(work)]) == 2
        assert f"{work}: it already exists and " in capsys.readouterr().err
        assert work.read_text() == "name = 'ours'\n"


def test_a_recording_is_not_its_own_judge(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was said to agree on data that was not fitted, which was what had been fitted."""
    path, link = write_csv_file(tmp_path / "run.csv", {"t": np.zeros(1)}), tmp_path / "link.csv"
    link.symlink_to(path)
    other = write_csv_file(tmp_path / "other.csv", {"t": np.zeros(1)})
    for recorded in ([path], [path, other]):
        assert main(["diagnose", *map(str, recorded), "--holdout", str(link)]) == 2
        assert f"--holdout {link}: it is also diagnosed" in capsys.readouterr().err


@pytest.mark.usefixtures("few_causes")
def test_an_error_of_the_recording_to_judge_on_names_that(
    drive: Columns, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, folder = write_csv_file(tmp_path / "run.csv", drive), tmp_path / "more"
    (folder / "none").mkdir(parents=True)
    gyro = {**drive, "imu.gyro.z": 57.3 * drive["imu.gyro.z"], "t": drive["t"] + 0.01}
    other = write_csv_file(folder / "other.csv", gyro)
    for named in (other, folder):  # a folder of one recording is that one
        assert main(["diagnose", str(path), "--holdout", str(named)]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"raccoon diagnose: --holdout {other}: imu.gyro.z is")
    assert main(["diagnose", str(path), "--holdout", str(folder / "none")]) == 2
    assert "there is no recording in it" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--json", "--html", "--save-model"])
def test_a_dash_is_no_file(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file of that name was written, into the folder that one is in."""
    assert main(["diagnose", str(tmp_path / "never-read.csv"), option, "-"]) == 2
    assert "-: it is not a file name; for the standard output write /dev/stdout" in capsys.readouterr().err


def test_two_results_need_two_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["diagnose", str(tmp_path / "never-read.csv"), "--json", str(out), "--html", str(out)]) == 2
    assert f"{out}: two results are to be written into it" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_said_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda path, _mode: Path(path) != tmp_path)
    assert main(["diagnose", str(tmp_path / "never-read.csv"), "--json", str(tmp_path / "out.json")]) == 2
    assert f"{tmp_path / 'out.json'}: nothing can be written there" in capsys.readouterr().err


def test_a_count_of_workers_is_not_negative(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", str(tmp_path / "never-read.csv"), "--workers", "-3"]) == 2
    assert "--workers -3: allowed are whole numbers from 0" in capsys.readouterr().err
    assert main(["diagnose", str(tmp_path / "never-read.csv"), "--scheduler", "tcp://x:1"]) == 2
    assert "--scheduler tcp://x:1: it needs --executor dask" in capsys.readouterr().err


def test_an_empty_name_is_not_the_folder_that_the_command_is_in(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        main(["diagnose", ""])
    assert "the name of a recording is empty" in capsys.readouterr().err


def test_many_files_one_of_them_bad(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [write_csv_file(tmp_path / f"run-{seed}.csv", dark(seed)) for seed in (5, 6)]
    (tmp_path / "empty.csv").write_text("")
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    names = [str(each) for each in (*paths, tmp_path / "empty.csv")]
    assert main(["diagnose", *names, "--json", str(out), "--html", str(page)]) == 0
    table = json.loads(out.read_text())
    assert set(table["recordings"]) == {"run-5.csv", "run-6.csv"}
    assert "the file is empty" in table["failed"]["empty.csv"]
    assert "[tophat.gain@2]: 100 % (common)" in capsys.readouterr().out
    assert "2 recordings" in page.read_text()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("empty", "the file is empty"),
        ("header", "the recording is empty"),
        ("text", "no column t"),
        ("two", "2 samples"),
        ("milliseconds", "milliseconds"),
        ("percent", "percent"),
        ("reversed", "go back"),
        ("degrees", "degrees"),
        ("nothing", "holds no numbers"),
    ],
)
def test_what_cannot_be_read_is_one_clear_line(
    name: str, said: str, drive: Columns, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"{name}.csv"
    duties = {key: each for key, each in drive.items() if key.endswith("duty")}
    match name:
        case "empty":
            path.write_text("")
        case "header":
            path.write_text(",".join(drive) + "\n")
        case "text":
            path.write_text("hello\nworld\n")
        case "two":
            write_csv_file(path, {key: each[:2] for key, each in drive.items()})
        case "milliseconds":
            write_csv_file(path, {**drive, "t": 1000.0 * drive["t"]})
        case "percent":
            write_csv_file(path, {**drive, **{key: 100.0 * each for key, each in duties.items()}})
        case "reversed":
            write_csv_file(path, {**drive, "t": drive["t"][::-1].copy()})
        case "degrees":
            write_csv_file(path, {**drive, "imu.gyro.z": 57.3 * drive["imu.gyro.z"]})
        case "nothing":
            write_csv_file(
                path, {**drive, **{key: np.full(len(each), np.nan) for key, each in duties.items()}}
            )
    assert main(["diagnose", str(path)]) == 2
    captured = capsys.readouterr().err
    assert said in captured
    assert str(path) in captured
    assert captured.count("\n") == 1


def test_a_time_that_comes_twice_costs_its_sample_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = dark(5)
    again = np.insert(np.arange(len(columns["t"])), 500, 499)
    path = write_csv_file(tmp_path / "run.csv", {name: each[again] for name, each in columns.items()})
    assert main(["diagnose", str(path)]) == 0
    said = capsys.readouterr().out
    assert (
        f"1 sample has the time of the one before and is left out: the first at {columns['t'][499]:.6g}"
        in said
    )
    half = np.arange(len(columns["t"])) // 2 * 2  # new readings, of which nobody knows when they were
    path = write_csv_file(tmp_path / "run.csv", {**columns, "t": columns["t"][half]})
    assert main(["diagnose", str(path)]) == 2
    assert f"{path}: t goes from" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("constant", "the commands never change"),
        ("other ports", "motor.2.duty and motor.3.duty change: is [drive] in robot.toml this robot's?"),
        ("saturated", "it is cut off there"),
        ("no wheels", "motor.0.bemf or motor.0.speed"),
        ("no commands", "motor.0.duty, motor.1.duty, truth.x are missing"),
    ],
)
def test_what_cannot_be_told_is_a_verdict(
    name: str, said: str, drive: Columns, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wheels = [key for key in drive if key.endswith(("bemf", "position"))]
    duties = [key for key in drive if key.endswith("duty")]
    match name:
        case "constant":
            columns = {**drive, **{key: np.zeros(len(drive["t"])) for key in duties}}
        case "other ports":
            moved = {f"motor.{port + 2}.duty": drive[f"motor.{port}.duty"] for port in (0, 1)}
            columns = {**drive, **{key: np.zeros(len(drive["t"])) for key in duties}, **moved}
        case "saturated":
            columns = {**drive, **{key: np.clip(drive[key], -200.0, 200.0) for key in wheels}}
        case "no wheels":
            columns = {key: each for key, each in drive.items() if key not in wheels}
        case _:
            columns = {key: each for key, each in drive.items() if key not in duties}
    assert (
        main(
            [
                "diagnose",
                str(write_csv_file(tmp_path / "run.csv", columns)),
                "--json",
                str(tmp_path / "out.json"),
            ]
        )
        == 0
    )
    assert json.loads((tmp_path / "out.json").read_text())["verdict"] == "not_identifiable"
    assert said in capsys.readouterr().out


def test_an_accelerometer_in_another_unit_is_said(
    drive: Columns, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    sound = Diagnosis(Verdict.ADEQUATE, (), (), (), Unexplained(0.0), (), 0.1)
    monkeypatch.setattr("raccoon.diagnose.recordings.drive.diagnose", lambda *_, **__: sound)
    axes = {"x": 0.0, "y": 0.0, "z": 1.0}
    columns = drive | {f"imu.accel.{name}": np.full(len(drive["t"]), each) for name, each in axes.items()}
    assert main(["diagnose", str(write_csv_file(tmp_path / "run.csv", columns))]) == 0
    said = capsys.readouterr().out
    assert "Note: imu.accel shows 1 m/s2 of gravity, which is 9.8: it looks like g, not m/s2" in said


def test_another_robots_file_is_an_error(
    drive: Columns, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robot.toml").write_text('name = "other"\n[drive]\nleft = 2\nright = 3\n')
    path = write_csv_file(tmp_path / "run.csv", drive)
    assert main(["diagnose", str(path), "--robot", str(tmp_path / "robot.toml")]) == 2
    assert "is it this robot's?" in capsys.readouterr().err


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("broken", [False, True])
@pytest.mark.usefixtures("few_causes")
def test_whoever_waits_at_a_terminal_is_told_what_it_is_doing(
    broken: bool, drive: Columns, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    path = write_csv_file(tmp_path / "run.csv", drive)
    if broken:

        def interrupted(*_: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr("raccoon.diagnose.habits.habit_search.find_habits", interrupted)
    main(["diagnose", str(path)])
    lines = screen.getvalue().split("\r")
    assert any("finding out what the controller does" in each for each in lines)
    assert any("looking for causes; so far none" in each for each in lines) is not broken
    last = max(index for index, each in enumerate(lines) if " s: " in each)
    assert lines[last + 1] == " " * len(lines[last])  # wiped out, whatever comes next
