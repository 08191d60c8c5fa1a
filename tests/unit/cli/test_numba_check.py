"""Commands without numba: what takes hours is refused in a line, what only takes longer is remarked."""

from pathlib import Path

import numpy as np
import pytest

from csv_files import write_csv_file
from raccoon.cli.main import main
from raccoon.diagnose.experiment.manoeuvres import MANOEUVRES, manoeuvre
from unit.diagnose.axes import motor

INSTALL = "pip install '.[sim]'"
pytestmark = pytest.mark.usefixtures("without_numba")


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    time = np.arange(0.0, 3.0, 0.01)
    columns = {"t": time, **dict.fromkeys(("motor.0.duty", "motor.1.duty"), np.full(len(time), 0.4))}
    return write_csv_file(tmp_path / "drive.csv", columns)


def test_a_drive_is_not_diagnosed(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for given in (drive, drive.parent):
        write_csv_file(drive.parent / "motor.csv", motor(5, 0.008))
        assert main(["diagnose", str(given)]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        (line,) = said.err.splitlines()
        assert line.startswith(f"raccoon diagnose: {drive}: a drive is diagnosed by simulating it")
        assert INSTALL in line


def test_of_motors_it_is_remarked_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_csv_file(tmp_path / "motor.csv", motor(5, 0.008))
    assert main(["diagnose", str(path)]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("numba is not installed")
    assert INSTALL in line


def test_a_file_that_cannot_be_read_is_said_as_always(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty.csv").write_text("")
    assert main(["diagnose", str(tmp_path / "empty.csv")]) == 2
    said = capsys.readouterr().err
    assert "empty" in said
    assert "numba" not in said


def test_what_a_drive_would_show_is_not_told_but_it_is_driven(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    short = manoeuvre("spin")[:100]
    monkeypatch.setitem(MANOEUVRES, "spin", lambda: short)
    robot_toml, run = tmp_path / "robot.toml", tmp_path / "run.jsonl.gz"
    robot_toml.write_text('[controller]\nport = "sim"\n')
    command = ["excite", "--robot", str(robot_toml)]
    for more in (["--manoeuvre", "spin"], ["--cause", "imu.latency", "--record", str(run)]):
        assert main([*command, *more]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert INSTALL in line
    assert "--manoeuvre" in line
    assert not run.exists()
    assert main([*command, "--manoeuvre", "spin", "--record", str(run)]) == 0
    assert run.exists()


def test_sweeps_are_played_with_a_remark(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("robot.toml").write_text("")
    Path("program.py").write_text("from raccoon import wait\ndef mission(robot):\n    robot.run(wait(0.1))\n")
    assert main(["sweep", "program.py", "--only", "0"]) == 0
    assert capsys.readouterr().err.startswith("numba is not installed")
