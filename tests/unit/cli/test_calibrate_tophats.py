from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raccoon import open_robot, seq, straight, wait
from raccoon.cli import main
from raccoon.core.config import RobotConfig
from raccoon.core.readings import SI_WORDS
from raccoon.estimate.tophat.store import TophatStore
from raccoon.model.bemf import counts_scale

ROBOT = "[tophat.left]\nanalog = 0\n[tophat.right]\nanalog = 1\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A robot with two sensors and a drive: the left one crosses a line, the right one sees bare floor."""
    rng = np.random.default_rng(0)
    left = np.where((np.arange(500) // 12) == 20, 3800.0, 1270.0) + rng.normal(0, 5, 500)
    right = rng.normal(1270, 5, 500)
    rows = [f"{i / 200:.3f},{a:.0f},{b:.0f},6.7" for i, (a, b) in enumerate(zip(left, right, strict=True))]
    header = "t,analog.0,analog.1,battery.voltage"
    (tmp_path / "drive.csv").write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    (tmp_path / "robot.toml").write_text(ROBOT, encoding="utf-8")
    return tmp_path


def command(folder: Path, *words: str) -> int:
    return main(["calibrate", "tophats", *words, "--store", str(folder / "tophats.json")])


def test_stores_what_it_believes_and_shows_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drive = [str(folder / "drive.csv"), "--robot", str(folder / "robot.toml"), "--set", "table"]
    assert command(folder, *drive, "--write") == 1  # the right sensor saw one surface
    told = capsys.readouterr().out
    assert "one_surface" in told
    assert told.endswith(f"wrote {folder / 'tophats.json'}, set table\n")
    assert command(folder, "--show") == 0
    shown = capsys.readouterr().out
    assert "left" in shown
    assert "right" not in shown
    assert "6.70 V" in shown
    assert "new at 7 mm\n" in shown
    store = TophatStore(folder / "tophats.json")
    (entry,) = store.history()
    store.add(replace(entry, ambient=0.26))  # as where only one sensor reads such levels
    assert command(folder, "--show") == 0
    assert "new at 7 mm, in 0.26 of direct sunlight\n" in capsys.readouterr().out


@pytest.mark.parametrize("other", ["drive.csv", "--write"])
def test_what_is_shown_is_not_made_as_well(
    folder: Path, capsys: pytest.CaptureFixture[str], other: str
) -> None:
    """Of the two, one was done and nothing said of the other."""
    assert command(folder, other, "--show") == 2
    assert capsys.readouterr().err.endswith(f"it only shows what is stored; leave out {other}\n")
    assert not (folder / "tophats.json").exists()


def test_long_names_leave_their_columns_apart(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = folder / "robot.toml"
    robot.write_text('[tophat."the left one of both"]\nanalog = 0\n', encoding="utf-8")
    drive = [str(folder / "drive.csv"), "--robot", str(robot)]
    for name in ("practice-table", "hall"):
        assert command(folder, *drive, "--set", name, "--write") == 0
    capsys.readouterr()
    assert command(folder, "--show", "--set", "hall") == 0
    assert "practice-table" not in capsys.readouterr().out
    assert command(folder, "--show", "--set", "default") == 1
    assert "no set default; there is practice-table, hall\n" in capsys.readouterr().out
    assert command(folder, "--show") == 0
    header, *rows = capsys.readouterr().out.splitlines()
    at = {name: header.index(name) for name in ("set", "time", "verdict")}
    for row, name in zip(rows, ("practice-table", "hall"), strict=True):
        assert row[: at["set"]].rstrip() == "the left one of both"
        assert row[at["set"] : at["time"]].strip() == name
        assert row[at["time"] - 1] == " "
        assert row[at["time"] :].startswith("20")


def test_what_a_simulated_robot_read_is_told_to_be_that(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`raccoon tune` said it, and a calibration of the simulator's recording went into robot.toml without."""
    robot = folder / "robot.toml"
    robot.write_text('[controller]\nport = "sim"\nrate_hz = 50.0\n[tophat.left]\nanalog = 0\n', "utf-8")
    with open_robot(robot, record=folder / "drive") as simulated:
        simulated.run(seq(wait(0.5), straight(0.9), wait(0.5)))
    for kind in (["tophats", "--store", str(folder / "t.json")], ["drive", "--straight", "0.9"]):
        assert main(["calibrate", *kind, str(folder / "drive"), "--robot", str(robot), "--write"]) == 0
        said = capsys.readouterr().out.splitlines()
        assert said[-2].startswith("wrote ")
        assert said[-1].startswith("these are the simulated robot's values: measure again on the real one")
    (stored,) = TophatStore(folder / "t.json").history()
    assert stored.robot == "robot (simulated)"


@pytest.mark.parametrize(
    ("store", "said"),
    [
        ("new/tophats.json", "there is no folder"),
        ("drive.csv", "this command reads it"),
        (".", "it is a folder; name a file"),
        ("robot.toml", "this command reads it"),
        ("notes.txt", "not a file of tophat calibrations"),
    ],
)
def test_a_store_that_cannot_be_written_is_refused_before_the_work(
    folder: Path, capsys: pytest.CaptureFixture[str], store: str, said: str
) -> None:
    (folder / "notes.txt").write_text("white is left", encoding="utf-8")
    before = sorted(each.name for each in folder.iterdir())
    words = [str(folder / "drive.csv"), "--robot", str(folder / "robot.toml"), "--store", str(folder / store)]
    assert main(["calibrate", "tophats", *words, "--write"]) == 2
    told = capsys.readouterr()
    assert said in told.err
    assert told.out == ""
    assert sorted(each.name for each in folder.iterdir()) == before


def test_without_write_nothing_is_stored(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command(folder, str(folder / "drive.csv"), "--robot", str(folder / "robot.toml"))
    assert "add --write" in capsys.readouterr().out
    assert not (folder / "tophats.json").exists()
    assert command(folder, "--show") == 1


def test_what_is_missing_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(folder) == 2
    assert "--show" in capsys.readouterr().err
    assert command(folder, str(folder / "drive.csv")) == 2
    assert "robot.toml" in capsys.readouterr().err
    assert command(folder, "--show", "--set", "") == 2
    assert "--set: the name of the set is empty" in capsys.readouterr().err


def test_a_seam_of_the_floor_is_no_line_in_a_recording(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At 0.25 m/s 6 rows are 8 mm, which no tape is as narrow as; 12 are 15 mm. The end of one drive and the
    beginning of the next are no piece of one line. Where the wheels are not told, anything dark may be one.
    """
    radius = RobotConfig().model.drive.wheel_radius.value
    turning = 0.25 / (radius * counts_scale(RobotConfig(), "left", SI_WORDS))
    robot = ["--robot", str(folder / "robot.toml")]

    def drive(name: str, *dark: int, told: bool = True, rest: int = 100) -> str:
        rows = []
        for i in range(500):
            counts, bemf = 3800 if i in dark else 1270 + i % 7, turning if i >= rest else 0.0
            rows.append(
                f"{i / 200:.3f},{counts},{1270 - i % 5}" + (f",{bemf:.0f},{bemf:.0f}" if told else "")
            )
        header = "t,analog.0,analog.1" + (",motor.0.bemf,motor.1.bemf" if told else "")
        (folder / name).write_text("\n".join([header, *rows, ""]), encoding="utf-8")
        return str(folder / name)

    line, seam = drive("line.csv", *range(300, 312)), drive("seam.csv", *range(300, 306))
    first, second = drive("first.csv", *range(495, 500)), drive("second.csv", *range(6), rest=0)
    for files, verdict in (
        ([line], "ok"),
        ([seam], "one_surface"),
        ([first, second], "one_surface"),
        ([drive("unknown.csv", *range(300, 306), told=False)], "ok"),
        ([line, seam], "ok"),
    ):
        command(folder, *files, *robot)
        (left,) = [row for row in capsys.readouterr().out.splitlines() if row.startswith("left")]
        assert verdict in left, files
