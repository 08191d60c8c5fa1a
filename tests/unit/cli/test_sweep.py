"""`raccoon sweep`: from the arguments to the words."""

import json
from pathlib import Path

import pytest

from raccoon.cli.main import main
from raccoon.sweep.results import read_results
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
    arguments = ["sweep", program, *VARIED, "--runs", "12", "--out", "r.csv", "--within", "0.005"]
    assert main([*arguments, "--workers", "1"]) == 0
    said = capsys.readouterr()
    rows = read_results("r.csv")
    failed = sum(row["status"] == "failed" for row in rows)
    assert f"drive.py: {failed} of 12 matches failed (seed 0)." in said.out
    assert "95 % interval" in said.out
    assert "1. battery.open_circuit_voltage.voltage" in said.out
    assert "12/12 matches" in said.err
    assert json.loads(Path("r.csv.sweep.json").read_text())["program"] == program

    assert main(arguments) == 0  # all is there: nothing is played
    again = capsys.readouterr()
    assert again.out == said.out
    assert again.err == ""

    assert main(["sweep", program, *VARIED, "--only", "7", "--record", "run.jsonl.gz"]) == 0
    assert f"{rows[7]['x']:.6g}" in capsys.readouterr().out
    assert main(["view", "run", "run.jsonl.gz"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere.py"], "nowhere.py"),
        (["drive.py", "--only-varied"], "nothing is varied"),
        (["drive.py", "--vary", "drive.wheel=2"], "there is no such id"),
        (["drive.py", "--faults", "3"], "fault.imu_silent is 3.0"),
        (["drive.py", "--runs", "0"], "runs is 0"),
        (["drive.py", "--workers", "-1"], "workers is -1"),
        (["drive.py", "--out", "r.txt"], "endings .csv and .parquet"),
        (["drive.py", "--scheduler", "tcp://x:1"], "--executor dask"),
        (["drive.py", "--within", "0"], "within is 0.0"),
        (["drive.py", "--table", "none.toml"], "none.toml"),
        (["drive.py", "--robot", "none.toml"], "none.toml"),
    ],
)
@pytest.mark.usefixtures("program")
def test_bad_input_is_named(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", *arguments]) == 2
    assert message in capsys.readouterr().err
    with process_crew(1) as crew:
        assert crew.window == 2
