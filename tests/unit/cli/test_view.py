"""`raccoon view`: a drive drawn over its table."""

import gzip
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.path import Path as Path2D

from raccoon import open_robot, straight, wait
from raccoon.cli.main import main
from raccoon.cli.view.drawing import _extent, _line_patch, _outline, _table, _trails
from raccoon.cli.view.drive import load_drive
from raccoon.core.config import BodyConfig, ControllerConfig, RobotConfig
from raccoon.core.errors import TraceError
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Line, World
from raccoon.trace.record import RecordingPort

TABLES = Path(__file__).resolve().parents[3] / "examples" / "tables"


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A quarter of a circle to the left, radius 0.5 m, in 2 s."""
    path = tmp_path / "drive.csv"
    rows = ["t,truth.x,truth.y,truth.heading,event"]
    for time in np.linspace(0.0, 2.0, 41):
        heading = time * np.pi / 4
        rows.append(f"{time},{0.5 * np.sin(heading)},{0.5 * (1 - np.cos(heading))},{heading},")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("ending", ["svg", "png"])
def test_it_draws_a_picture(recording: Path, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f"drive.{ending}"
    table = str(TABLES / "workshop.toml")
    assert main(["view", str(recording), "-o", str(target), "--table", table]) == 0
    beginning = target.read_bytes()[:200]
    assert (b"<?xml" in beginning) if ending == "svg" else beginning.startswith(b"\x89PNG")
    assert [each.name for each in tmp_path.glob(".*")] == []


def test_the_same_drive_gives_the_same_picture(recording: Path, tmp_path: Path) -> None:
    for name in ("one.svg", "two.svg"):
        assert main(["view", str(recording), "-o", str(tmp_path / name)]) == 0
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()


def test_an_animation_says_which_path_is_which(recording: Path) -> None:
    drive = load_drive(recording)
    _, axes = _table(World(), drive)
    _trails(axes, drive)
    assert [each.get_text() for each in axes.get_legend().get_texts()] == ["truth"]


@pytest.mark.parametrize(("speed", "most"), [("4", 600), ("0.5", 7)])
def test_an_animation_is_as_fast_as_asked_for_however_many_frames_it_has(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, speed: str, most: int
) -> None:
    monkeypatch.setattr("raccoon.cli.view.drawing.MAX_FRAMES", most)
    target = tmp_path / "drive.gif"
    assert main(["view", str(recording), "-o", str(target), "--no-table", "--speed", speed]) == 0
    assert target.read_bytes().startswith(b"GIF89a")
    from PIL import Image, ImageSequence

    with Image.open(target) as animation:
        seconds = sum(frame.info["duration"] for frame in ImageSequence.Iterator(animation)) / 1000
    assert seconds == pytest.approx(2.0 / float(speed), rel=0.02)


def test_a_drive_that_was_elsewhere_is_drawn_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half a metre to the right of the usual start there is a wall."""
    path, picture = tmp_path / "drive.csv", str(tmp_path / "drive.svg")
    rows = [f"{0.1 * row},0,{-0.07 * row},-1.57" for row in range(20)]
    path.write_text("\n".join(["t,truth.x,truth.y,truth.heading", *rows]) + "\n", encoding="utf-8")
    for said, more in (
        (True, []),
        (False, ["--start", "0", "0", "0"]),  # 1.9 m ahead of it stands another one
        (True, ["--start", "0", "0.5", "0"]),  # with its left side
        (False, ["--no-table"]),
    ):
        assert main(["view", str(path), "-o", picture, *more]) == 0
        assert ("note: the drive goes through a wall" in capsys.readouterr().out) is said


def test_how_far_and_how_long(recording: Path) -> None:
    drive = load_drive(recording)
    assert drive.seconds == 2.0
    assert drive.length == pytest.approx(0.5 * np.pi / 2, rel=1e-3)


def test_what_was_said_on_the_way_is_printed_with_its_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run.csv"
    rows = ["t,truth.x,truth.y,truth.heading,event", "0,0,0,0,match begins: 120 s", "0.5,0.1,0,0,"]
    path.write_text("\n".join([*rows, "1.25,0.2,0,0,remark: bumped"]) + "\n", encoding="utf-8")
    assert main(["view", str(path), "-o", str(tmp_path / "drive.svg"), "--no-table"]) == 0
    told = capsys.readouterr().out.splitlines()[1:]
    assert told == ["    0.00 s  match begins: 120 s", "    1.25 s  remark: bumped"]


def test_what_is_damaged_in_a_recording_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of one that was cut off half a match was drawn without a word."""
    with open_robot(RobotConfig(controller=ControllerConfig(port="sim")), record=tmp_path / "run") as robot:
        robot.run(wait(0.1))
    path = tmp_path / "cut.jsonl"
    lines = gzip.decompress((tmp_path / "run.jsonl.gz").read_bytes()).splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]))
    assert main(["view", str(path), "-o", str(tmp_path / "drive.svg"), "--no-table"]) == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    assert len(notes) == 1
    assert notes[0].endswith("the recording was not closed: it has no last line")


def test_of_a_note_in_every_cycle_the_first_hundred_are_printed(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{0.01 * row:.2f},{0.001 * row},0,0,note {row}" for row in range(103)]
    recording.write_text("\n".join(["t,truth.x,truth.y,truth.heading,event", *rows]) + "\n", encoding="utf-8")
    assert main(["view", str(recording), "-o", str(tmp_path / "drive.svg"), "--no-table"]) == 0
    told = capsys.readouterr().out.splitlines()[1:]
    assert told[99:] == ["    0.99 s  note 99", "and 3 more, all in the column event of raccoon convert"]


def test_the_robot_is_drawn_as_long_and_as_wide_as_it_was_recorded(tmp_path: Path) -> None:
    for front in (0.09, 0.2):
        config = RobotConfig(controller=ControllerConfig(port="sim"), body=BodyConfig(front=front))
        path = tmp_path / f"front {front}.jsonl"
        with open_robot(config, record=path, seed=1) as robot:
            robot.run(wait(0.1))
        drive = load_drive(path.with_suffix(".jsonl.gz"))
        assert drive.body == config.body
        corners, (line, _) = _outline(drive.best, 0, drive.body)
        assert corners[:, 0].tolist() == pytest.approx([front, -0.09, -0.09, front])
        assert corners[:, 1].tolist() == pytest.approx([0.09, 0.09, -0.09, -0.09])
        assert line.tolist() == pytest.approx([0.0, front])


@pytest.mark.parametrize("world", [World.default(), World.empty()], ids=["table", "no table"])
def test_the_whole_robot_is_in_the_picture_wherever_it_ends(recording: Path, world: World) -> None:
    """Beyond the border of the table half of it was cut off."""
    drive = load_drive(recording, (1.9, 0.4, 0.0))
    low, high = _extent(world, drive)
    for row in range(0, 41, 8):
        corners, _ = _outline(drive.best, row, drive.body)
        assert (corners >= low).all()
        assert (corners <= high).all()


def test_what_the_robot_believed_is_drawn_of_a_converted_recording_too(tmp_path: Path) -> None:
    config = RobotConfig(controller=ControllerConfig(port="emulator"))
    with open_robot(config, record=tmp_path / "run") as robot:
        robot.run(straight(0.02))
    assert main(["convert", str(tmp_path / "run"), str(tmp_path / "run.csv")]) == 0
    native, converted = load_drive(tmp_path / "run.jsonl.gz").best, load_drive(tmp_path / "run.csv").best
    assert native.x[-1] == pytest.approx(0.02, abs=0.001)
    for name in ("time", "x", "y", "heading"):
        np.testing.assert_allclose(getattr(converted, name), getattr(native, name), atol=1e-6)


def test_it_can_be_moved_to_where_it_started(recording: Path) -> None:
    path = load_drive(recording, (1.0, 0.2, 90.0)).best
    assert (path.x[0], path.y[0]) == (1.0, 0.2)
    assert path.x[-1] == pytest.approx(0.5)
    assert path.y[-1] == pytest.approx(0.7)


def test_a_recording_without_poses_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "blind.csv"
    path.write_text("t,motor.0.duty\n0.0,0.1\n0.1,0.1\n", encoding="utf-8")
    with pytest.raises(TraceError, match="nor estimates"):
        load_drive(path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "drive.pdf"], ".svg, .png, .gif"),
        (["--speed", "0"], "--speed 0: "),
        (["--speed", "1e-320"], "allowed are numbers from 0.01 to 1000"),
        (["--start", "nan", "0", "0"], "--start nan 0 0: allowed are X and Y"),
        (["--start", "1e300", "0", "0"], "--start 1e+300 0 0: allowed are X and Y"),
        (["-o", "nowhere/drive.svg"], "there is no folder nowhere"),
        (["--table", "t.toml", "--no-table"], "--table t.toml: --no-table draws none; leave one of them out"),
        (["other.csv"], "other.csv: one recording is drawn at a time"),
    ],
)
def test_impossible_wishes_are_refused(
    recording: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", str(recording), *arguments]) == 2
    assert message in capsys.readouterr().err


def test_the_word_run_may_stand_before_the_recording(recording: Path, tmp_path: Path) -> None:
    for number, words in enumerate(([str(recording), "--no-table"], ["--no-table", str(recording)])):
        target = tmp_path / f"drive{number}.svg"
        assert main(["view", "run", "-o", str(target), *words]) == 0
        assert target.exists()


def test_a_recording_may_have_the_name_run(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(recording.parent)
    recording.rename("run")
    assert main(["view", "run"]) == 0
    Path("run").unlink()
    port = RecordingPort(SimPort(Parameters()), "run")
    for _ in range(3):
        port.read()
    port.close()
    assert main(["view", "run", "-o", "packed.svg"]) == 0


def test_a_folder_is_no_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (f"raccoon view: {tmp_path}: it is a folder; name a recording in it\n")


def test_without_matplotlib_it_says_how_to_install_it(
    recording: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    path = str(recording)
    for words in (["view", path], ["replay", path, "--plot", "a.svg"], ["effects", "--write", "."]):
        assert main(words) == 2
        assert "pictures need matplotlib: pip install '.[report]'" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ["svg", "gif"])
def test_an_interruption_leaves_no_part_of_a_picture(
    ending: str, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    for name in ("matplotlib.figure.Figure.savefig", "matplotlib.backends.backend_agg.FigureCanvasAgg.draw"):
        monkeypatch.setattr(name, interrupted)
    assert main(["view", str(recording), "-o", str(tmp_path / f"drive.{ending}")]) == 130
    assert [each.name for each in tmp_path.iterdir()] == ["drive.csv"]


def test_a_line_is_drawn_where_the_tophats_see_it() -> None:
    corner = Line(((0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.2, 0.5), (0.5, 0.5)), width=0.06)
    drawn = _line_patch(corner).get_path()
    table = World(lines=(corner,))
    for x, y in np.random.default_rng(1).uniform(-0.1, 0.6, (300, 2)):
        if abs(table.nearest_line(x, y)[0]) > 1e-3:
            black = table.nearest_line(x, y)[0] < 0.0
            # Any part that holds it: overlaps are filled as well.
            parts = [Path2D(each) for each in drawn.to_polygons()]
            assert any(part.contains_point((x, y)) for part in parts) == black, (x, y)


def test_light_and_ramps_that_reach_everywhere_are_drawn(recording: Path, tmp_path: Path) -> None:
    table = tmp_path / "table.toml"
    everywhere = "low = [-inf, -inf]\nhigh = [inf, inf]\n"
    table.write_text(f"[[light]]\n{everywhere}ambient = 0.5\n[[ramp]]\n{everywhere}along_x = 0.1\n")
    target = tmp_path / "drive.png"
    assert main(["view", str(recording), "-o", str(target), "--table", str(table)]) == 0
    from PIL import Image

    red, _, blue = np.asarray(Image.open(target).convert("RGB")).astype(int).T
    assert np.mean(red - blue > 20) > 0.3  # yellow, between the ramp's stripes


def test_what_the_robot_believed_meets_the_truth_where_both_begin(tmp_path: Path) -> None:
    path = tmp_path / "cut.csv"
    path.write_text(
        "t,truth.x,truth.y,truth.heading,estimate.drive.0,estimate.drive.1,estimate.drive.2\n"
        f"0,,,,0.5,0.2,0\n1,1,0,{np.pi / 2},0.6,0.2,0\n2,1,0.4,{np.pi / 2},1.1,0.2,0\n"
    )
    estimate = load_drive(path).estimate
    assert estimate is not None
    assert np.column_stack([estimate.x, estimate.y]) == pytest.approx(
        np.array([[1.0, -0.1], [1.0, 0.0], [1.0, 0.5]])
    )


def test_what_has_nothing_to_draw_is_drawn_by_the_odometry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A manoeuvre on a real controller has neither truth nor a robot that believes anything."""
    bare = tmp_path / "bare.csv"
    bare.write_text("t,motor.0.bemf\n0,0\n0.005,0\n", encoding="utf-8")
    assert main(["view", str(bare), "-o", str(tmp_path / "bare.png")]) == 2
    assert "raccoon replay RECORDING --plot drive.svg draws" in capsys.readouterr().err
