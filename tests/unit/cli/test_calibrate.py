"""`raccoon calibrate drive`, from a recording to robot.toml."""

import csv
import math
import re
from pathlib import Path

import pytest

from drive_traces import Errors, Segment, drive
from raccoon.cli.main import main
from raccoon.core.config import Measured, load_robot

SQUARE: list[Segment] = [(2.5, 0.2, 0.0), (0.7, 0.0, 0.0), (1.0, 0.0, 1.6), (0.7, 0.0, 0.0)] * 2
BACK: list[Segment] = [(s, v, -w) for s, v, w in SQUARE]
WAIT: list[Segment] = [(1.5, 0.0, 0.0)]
ODD = Errors(scale=(1.03, 0.97), offset_counts=(30.0, -20.0))
PER_TICK = 3.3 / 4096 * 9.0 / 2.2 / 1.08


def recording(path: Path, segments: list[Segment], *, truth: bool) -> float:
    """Write a CSV recording; gives the distance between its ends, m."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        names = ["t", "motor.0.bemf", "motor.1.bemf", "motor.0.position", "motor.1.position", "imu.gyro.z"]
        writer.writerow(
            [*names, "battery.voltage", *(["truth.x", "truth.y", "truth.heading"] if truth else [])]
        )
        for inputs, _ in drive(segments, ODD):
            at = inputs.truth
            assert at is not None
            row = [inputs.time, *inputs.bemf[:2], *inputs.position[:2], inputs.turn_rate, 6.6]
            writer.writerow([*row, *([at.x, at.y, at.heading] if truth else [])])
    assert at is not None
    return math.hypot(at.x, at.y)


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text('name = "drumbot"  # ours\n', encoding="utf-8")
    return path


def test_straight_drive_is_shown_and_written_only_when_told(
    tmp_path: Path, robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "straight.csv"
    distance = recording(file, [*WAIT, (3.2, 0.2, 0.0), *WAIT], truth=False)
    arguments = ["calibrate", "drive", str(file), "--robot", str(robot), "--straight", str(distance)]
    assert main([*arguments[:-1], str(0.87 * distance)]) == 0  # misread, by less than wheels may be off
    said = capsys.readouterr().out
    assert "motor.0.radians_per_tick" in said
    first = re.match(r"by tape (\S+) m, by robot.toml as it was (\S+) m\n", said)
    assert first is not None
    assert float(first[1]) == pytest.approx(0.87 * distance)
    assert float(first[2]) == pytest.approx(distance, rel=0.005)
    assert robot.read_text(encoding="utf-8") == 'name = "drumbot"  # ours\n'
    assert main([*arguments, "--write"]) == 0
    assert capsys.readouterr().out.endswith(f"wrote {robot}\n"), "nothing was replaced"
    assert not (tmp_path / "robot.history.toml").exists()
    assert main([*arguments, "--write"]) == 0
    said = capsys.readouterr().out
    assert said.endswith(f"wrote {robot}; what was replaced is in robot.history.toml beside it\n")
    assert (tmp_path / "robot.history.toml").exists()
    motor = load_robot(robot).motor(0)
    assert motor.radians_per_tick is not None
    assert motor.radians_per_tick.value == pytest.approx(PER_TICK / 1.03, rel=0.01)
    assert motor.radians_per_tick.battery_voltage == pytest.approx(6.6)
    assert robot.read_text(encoding="utf-8").startswith('name = "drumbot"  # ours\n')


def test_the_robot_toml_of_the_folder_is_taken(
    tmp_path: Path, robot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording(tmp_path / "straight.csv", [*WAIT, (1.6, 0.2, 0.0), *WAIT], truth=False)
    monkeypatch.chdir(robot.parent)
    assert main(["calibrate", "drive", "straight.csv", "--straight", "0.32", "--write"]) == 0
    assert load_robot(robot).motor(0).radians_per_tick is not None


def test_manoeuvre_with_a_reference_gives_the_track_too(tmp_path: Path, robot: Path) -> None:
    file = tmp_path / "squares.csv"
    recording(file, [*WAIT, *SQUARE, *BACK, *WAIT], truth=True)
    assert main(["calibrate", "drive", str(file), "--robot", str(robot), "--write"]) == 0
    track = load_robot(robot).model.drive.track_width
    assert track.value == pytest.approx(0.16, rel=0.005)
    assert track.date is not None


def test_a_time_in_milliseconds_is_said_to_be_one(
    tmp_path: Path, robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "squares.csv"
    recording(file, [*WAIT, *SQUARE, *BACK, *WAIT], truth=True)
    header, *rows = file.read_text().splitlines()
    cells = [row.partition(",") for row in rows]
    file.write_text("\n".join([header, *(f"{1e3 * float(t)},{rest}" for t, _, rest in cells), ""]))
    assert main(["calibrate", "drive", str(file), "--robot", str(robot)]) == 2
    assert "squares.csv: t advances by 5 s a sample: it looks like milliseconds" in capsys.readouterr().err


def test_an_offset_that_may_be_0_has_no_share(
    tmp_path: Path, robot: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    entries = {
        "motor.0.bemf_offset": Measured(-0.17, std=0.24),
        "motor.1.bemf_offset": Measured(-0.76, std=0.67),
        "model.drive.track_width": Measured(0.16, std=0.001),
    }
    monkeypatch.setattr("raccoon.cli.calibrate.drive._manoeuvre", lambda *_: entries)
    recording(tmp_path / "run.csv", SQUARE[:1], truth=False)
    assert main(["calibrate", "drive", str(tmp_path / "run.csv"), "--robot", str(robot)]) == 0
    left, right, track, _ = capsys.readouterr().out.splitlines()
    assert left.endswith("-0.17 +- 0.24 counts")
    assert right.endswith("-0.76 +- 0.67 counts")
    assert track.endswith("0.1600 +- 0.0010 m (0.62 %)")


def test_one_turning_direction_is_refused_with_the_manoeuvre_that_would_do(
    tmp_path: Path, robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "left.csv"
    recording(file, [*WAIT, *SQUARE, *WAIT], truth=True)
    assert main(["calibrate", "drive", str(file), "--robot", str(robot), "--write"]) == 2
    assert "once to the left and once to the right" in capsys.readouterr().err
    assert robot.read_text(encoding="utf-8") == 'name = "drumbot"  # ours\n'


@pytest.mark.parametrize(
    ("extra", "reason"),
    [
        (["--tape", "1:2"], "BEGIN:END:METRES"),
        (["--straight", "0.6", "--tape", "1:2:0.6"], "one recording and no --tape: given are --tape 1:2:0.6"),
        (["--tape-std", "0", "--straight", "0.6"], "--tape-std 0: allowed are numbers above 0 (m)"),
        (["--tape-std", "nan", "--tape", "1:2:0.6"], "--tape-std nan: allowed are numbers above 0 (m)"),
        (["--tape-std", "0.4", "--straight", "0.6"], "it must be below half of --straight 0.6"),
        (["--straight", "inf"], "--straight inf: allowed are numbers other than 0, up to 10 m"),
        (["--straight", "60"], "up to 10 m either way (60 cm are 0.60)"),
        (["--tape", "1:2:60"], "METRES not 0, up to 10 (60 cm are 0.60)"),
        ([], "if this is one straight drive, give its length: --straight METRES"),
        (["--tape", "2:1:0.6"], "BEGIN must be before END"),
        (["--tape", "1:2:nan"], "METRES not 0"),
    ],
)
def test_bad_arguments_are_told(
    tmp_path: Path, robot: Path, capsys: pytest.CaptureFixture[str], extra: list[str], reason: str
) -> None:
    file = tmp_path / "wait.csv"
    recording(file, WAIT, truth=False)
    assert main(["calibrate", "drive", str(file), "--robot", str(robot), *extra]) == 2
    assert reason in capsys.readouterr().err
