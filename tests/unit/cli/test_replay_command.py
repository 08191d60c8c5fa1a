import argparse
import io
import json
import math
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from raccoon import Robot, RobotConfig, deg, motors, open_robot, race, seq, straight, turn, wait
from raccoon.cli import replay
from raccoon.cli.replay import picture
from raccoon.cli.replay.drive import replay_odometry
from raccoon.cli.view.drive import load_drive
from raccoon.core.config import ControllerConfig
from raccoon.core.errors import ConfigError, TraceError
from raccoon.diagnose.drives.time_column import check_time
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World
from raccoon.trace.columns import recording_of
from raccoon.trace.csv import write_csv
from raccoon.trace.format import read_trace
from raccoon.trace.loading import load_run
from raccoon.trace.recording import Recording

PROGRAM = "from raccoon import seq, straight, wait\n\ndef mission(robot):\n    robot.run({})\n"


def mission(robot: Robot) -> None:
    robot.run(seq(wait(0.2), straight(0.05)))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "run.jsonl.gz"
    config = RobotConfig()
    port = SimPort(Parameters.from_robot(config), World.empty(), robot=config, seed=3)
    with open_robot(config, port=port, record=path, seed=3) as robot:
        mission(robot)
    return path


def run(*argv: object) -> int:
    parser = argparse.ArgumentParser()
    replay.configure(parser)
    return replay.run(parser.parse_args([str(each) for each in argv]))


def straight_drive(speed: float, seconds: float = 4.0) -> Recording:
    """Encoder ticks and truth of the default robot, which drives straight to x = speed * seconds."""
    t = np.arange(0.0, seconds, 0.05)
    radians_per_tick = 1.0 / 303.4 / 1.08  # of the default robot, see docs/quantities.md
    ticks = np.round(speed * t / 0.0345 / radians_per_tick)
    zero = np.zeros_like(t)
    truth = {"truth.x": speed * t, "truth.y": zero, "truth.heading": zero}
    return Recording({"t": t, "motor.0.position": ticks, "motor.1.position": ticks} | truth)


def test_a_trace_gives_the_identical_estimate(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(recorded, "--json", tmp_path / "out.json") == 0
    assert "identical to the estimate while driving, in every cycle" in capsys.readouterr().out
    [result] = json.loads((tmp_path / "out.json").read_text())["runs"]
    assert result["deviation_from_recorded_estimate"] == 0.0
    assert result["error"]["rms"] < 0.005


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A drive in which wheels and gyro turn, and commands are steady for a while."""
    config = RobotConfig()
    path = tmp_path_factory.mktemp("turned") / "run.jsonl.gz"
    port = SimPort(Parameters.from_robot(config), World.empty(), robot=config, seed=3)
    with open_robot(config, port=port, record=path, seed=3) as robot:
        robot.run(seq(wait(1.2), straight(0.2), turn(deg(90)), race(motors(-0.8, 0.5), wait(3.0))))
    return recording_of(read_trace(path))


@pytest.mark.parametrize(
    ("column", "factor", "said", "every"),
    [
        ("imu.gyro", math.degrees(1.0), "it looks like degrees, not radians", 4),
        ("imu.gyro", 939.0, "the sensor's own counts", 4),
        (".bemf", 1.0 / 303.4, "it looks like volts or radians a second, not counts", 4),
        (".bemf", 1000.0 / 303.4, "it looks like millivolts, not counts", 4),
        ("battery.voltage", 1000.0, "it looks like millivolts, not volts", 4),
        ("imu.accel", 1.0 / 9.81, "it looks like g, not m/s2", 4),
        ("imu.gyro", 1.0, "", 1),
        ("imu.gyro", 1.0, "", 4),
    ],
)
def test_readings_in_another_unit_are_said(
    column: str,
    factor: float,
    said: str,
    every: int,
    turned: Recording,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As a diagnosis refuses them; also of rows that are too far apart for one."""
    columns = {
        name: (factor if column in name else 1.0) * values[::every] for name, values in turned.columns.items()
    }
    write_csv(Recording(columns), tmp_path / "run.csv")
    assert run(tmp_path / "run.csv") == 0
    told = capsys.readouterr().out
    assert said in told
    assert ("the odometry took it as it is" in told) is bool(said)


def test_its_csv_gives_the_same_estimate_within_rounding(recorded: Path, tmp_path: Path) -> None:
    write_csv(recording_of(read_trace(recorded)), tmp_path / "run.csv")
    run(tmp_path / "run.csv", "--json", tmp_path / "out.json")
    [result] = json.loads((tmp_path / "out.json").read_text())["runs"]
    assert result["deviation_from_recorded_estimate"] < 1e-9


def test_error_against_the_truth_is_pooled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, speed in (("a", 0.1), ("b", 0.2)):
        write_csv(straight_drive(speed), tmp_path / f"{name}.csv")
    (tmp_path / "robot.toml").write_text("")
    run(tmp_path, "--robot", tmp_path / "robot.toml", "--json", tmp_path / "out.json")
    results = json.loads((tmp_path / "out.json").read_text())
    assert results["pooled"]["runs"] == 2
    assert results["pooled"]["rms"] < 0.01
    assert results["runs"][1]["error"]["distance"] == pytest.approx(0.2 * 3.95)
    assert results["runs"][1]["end"]["x"] == pytest.approx(0.2 * 3.95, rel=0.02)
    assert "pooled over 2 runs with truth" in capsys.readouterr().out


def test_another_robot_gives_another_drive(tmp_path: Path) -> None:
    write_csv(straight_drive(0.2), tmp_path / "run.csv")
    (tmp_path / "robot.toml").write_text("[model.drive]\nwheel_radius = 0.069\n")
    run(tmp_path / "run.csv", "--robot", tmp_path / "robot.toml", "--json", tmp_path / "out.json")
    [result] = json.loads((tmp_path / "out.json").read_text())["runs"]
    assert result["end"]["x"] == pytest.approx(2 * 0.2 * 3.95, rel=0.02)


def test_without_truth_there_is_no_error_and_the_robot_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = {name: each for name, each in straight_drive(0.1).columns.items() if "truth" not in name}
    write_csv(Recording(columns), tmp_path / "run.csv")
    run(tmp_path / "run.csv")
    said = capsys.readouterr().out
    assert "does not contain its robot" in said
    assert "pooled" not in said


@pytest.mark.parametrize(
    ("body", "status", "message"),
    [
        ("seq(wait(0.2), straight(0.05))", 0, "the same in all of"),
        ("seq(wait(0.2), straight(0.06))", 1, r"motor.0.duty was"),
        ("seq(wait(0.2), straight(0.05), wait(1.0))", 0, "the program still ran when"),
        ("wait(0.1)", 1, r"tick 41: motor.0.duty was"),
    ],
)
def test_a_program_must_command_the_same(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], body: str, status: int, message: str
) -> None:
    (tmp_path / "team.py").write_text(PROGRAM.format(body))
    assert run(recorded, "--program", tmp_path / "team.py") == status
    assert message in capsys.readouterr().out


def test_a_program_that_does_nothing_is_not_the_same(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "team.py").write_text("def mission(robot): pass\n")
    assert run(recorded, "--program", tmp_path / "team.py") == 1
    said = capsys.readouterr().out
    assert "tick 41: motor.0.duty was" in said
    assert "it must do everything with the robot that was done in the recording" in said
    assert run(recorded, "--program", tmp_path / "team.py", "--ignore-commands") == 0
    assert re.search(r"ran in 0 of \d+ cycles; its commands were not compared", capsys.readouterr().out)


def test_a_recording_may_rest_after_its_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = SimPort(Parameters.from_robot(RobotConfig()))
    with open_robot(RobotConfig(), port=port, record=tmp_path / "run") as robot:
        mission(robot)
        robot.stop()
        ticks = robot.ticks
        robot.run(wait(0.1))
    text = (
        "from raccoon import seq, straight, wait\ndef mission(robot): return seq(wait(0.2), straight(0.05))\n"
    )
    (tmp_path / "team.py").write_text(text)
    assert run(tmp_path / "run.jsonl.gz", "--program", tmp_path / "team.py") == 0
    assert f"the same in the first {ticks} of {robot.ticks} cycles, and ended" in capsys.readouterr().out


def test_an_action_is_a_program_too(recorded: Path, tmp_path: Path) -> None:
    text = "from raccoon import seq, straight, wait\nmission = seq(wait(0.2), straight(0.05))\n"
    (tmp_path / "team.py").write_text(text)
    assert run(recorded, "--program", tmp_path / "team.py") == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1 / 0\n", r"team\.py, line 1: ZeroDivisionError: division by zero"),
        ("\ndef mission(robot):\n    1 / 0\n", r"team\.py, line 3: ZeroDivisionError: division by zero"),
        ("import sys\ndef mission(robot):\n    sys.exit()\n", r"team\.py, line 3: SystemExit"),
        ("def mission(\n", r"team\.py: SyntaxError: '\(' was never closed \(team\.py, line 1\)"),
        ("\0", r"team\.py: .*null bytes"),
    ],
)
def test_what_a_program_does_wrong_is_said_with_its_line(
    recorded: Path, tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "team.py").write_text(text)
    with pytest.raises(ConfigError, match=f"--program .*{message}"):
        run(recorded, "--program", tmp_path / "team.py")


def test_a_file_that_cannot_be_used_does_not_stop_the_others(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a folder every file is looked at; what is wrong with one is said, and the exit status is that of bad
    input."""
    shutil.copy(recorded, tmp_path / "b.jsonl.gz")
    (tmp_path / "a.csv").write_text("t,motor.0.duty\n0,0\n")
    (tmp_path / "c.jsonl").write_text("no trace\n")
    out = tmp_path / "out.json"
    assert run(tmp_path, tmp_path / "missing.csv", "--json", out) == 2
    told = capsys.readouterr().out
    assert f"{tmp_path / 'a.csv'}: not replayed: neither motor.0.position nor motor.0.bemf" in told
    assert f"{tmp_path / 'missing.csv'}: not replayed: No such file or directory" in told
    assert "identical to the estimate while driving" in told
    results = json.loads(out.read_text())
    assert [each["name"] for each in results["runs"]] == ["b.jsonl.gz"]
    assert list(results["failed"]) == [str(tmp_path / name) for name in ("a.csv", "c.jsonl", "missing.csv")]


def test_of_a_folder_without_a_file_that_can_be_used_nothing_is_drawn(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("")
    assert run(tmp_path, "--plot", tmp_path / "out.svg") == 2
    assert not (tmp_path / "out.svg").exists()


def test_a_program_is_replayed_on_every_trace_of_a_folder(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(recorded, tmp_path / "b.jsonl.gz")
    write_csv(recording_of(read_trace(recorded)), tmp_path / "a.csv")
    (tmp_path / "team.py").write_text(PROGRAM.format("seq(wait(0.2), straight(0.05))"))
    assert run(tmp_path, "--program", tmp_path / "team.py") == 2
    told = capsys.readouterr().out
    assert "a.csv: not replayed: a program needs a trace" in told
    assert "b.jsonl.gz: the same in all of" in told


def test_a_picture_is_drawn(recorded: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    run(recorded, "--plot", tmp_path / "out.svg")
    assert "<svg" in (tmp_path / "out.svg").read_text()
    assert [each.name for each in tmp_path.iterdir()] == ["out.svg"]


def test_a_straight_drive_is_no_strip_that_its_legend_hides(recorded: Path) -> None:
    figure = pytest.importorskip("matplotlib.figure").Figure(figsize=(4.5, 4.3), layout="constrained")
    axes = figure.subplots()
    picture._draw_one(axes, replay_odometry(load_run(recorded)))
    figure.draw_without_rendering()
    box = axes.get_window_extent()
    assert box.height > 0.7 * box.width
    (low, high), (left, right) = axes.get_ylim(), axes.get_xlim()
    assert (high - low) / (right - left) == pytest.approx(box.height / box.width)  # a turn looks as it is
    assert axes.get_title().startswith("run.jsonl.gz\noff by 0.")
    truth, odometry, *_ = axes.get_lines()
    assert truth.get_linewidth() > 3.0 * odometry.get_linewidth()  # or the one would hide the other


def test_bad_arguments_are_named(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--plot out\.bmp: allowed are the endings"):
        run(recorded, "--plot", "out.bmp")
    with pytest.raises(ConfigError, match="--tolerance nan: allowed are numbers from 0 to below 1"):
        run(recorded, "--tolerance", "nan")
    for words in (["--ignore-commands"], ["--tolerance", "0.1"]):
        with pytest.raises(ConfigError, match=f"{words[0]}: it only applies to --program; name a program"):
            run(recorded, *words)
    with pytest.raises(ConfigError, match="there is no folder"):
        run(recorded, "--json", tmp_path / "missing" / "out.json")
    with pytest.raises(ConfigError, match="--program prints what it finds and writes nothing"):
        run(recorded, "--program", tmp_path / "team.py", "--json", tmp_path / "out.json")
    with pytest.raises(ConfigError, match="no such file"):
        run(recorded, "--program", tmp_path / "team.py")
    (tmp_path / "team.py").write_text("x = 1\n")
    with pytest.raises(ConfigError, match="--tolerance nan: allowed are numbers from 0 to below 1"):
        run(recorded, "--program", tmp_path / "team.py", "--tolerance", "nan")
    with pytest.raises(ConfigError, match=r"must define mission\(robot\)"):
        run(recorded, "--program", tmp_path / "team.py")
    (tmp_path / "run.csv").write_text("t,analog.0\n0,1\n")
    with pytest.raises(TraceError, match=r"neither motor\.0\.position nor motor\.0\.bemf"):
        run(tmp_path / "run.csv")


def test_an_empty_recording_is_said_to_be_empty(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.csv").write_text("t,motor.0.position,motor.1.position\n")
    with open_robot(RobotConfig(controller=ControllerConfig(port="sim")), record=tmp_path / "run"):
        pass  # ended before its first cycle: no wheel is missing in it
    for name in ("run.csv", "run.jsonl.gz"):
        run(tmp_path / name)
        assert "nothing recorded" in capsys.readouterr().out
    with pytest.raises(TraceError, match="the recording is empty: it was ended before its first cycle"):
        load_drive(tmp_path / "run")


def test_a_result_replaces_neither_what_is_read_nor_what_took_hours(recorded: Path, tmp_path: Path) -> None:
    own = Path(shutil.copy(recorded, tmp_path / "run.jsonl.gz"))
    before = own.read_bytes()
    for written in (own, tmp_path / "." / own.name):
        with pytest.raises(ConfigError, match="this command reads it; choose another name"):
            run(own, "--json", written)
    with pytest.raises(ConfigError, match="this command reads it; choose another name"):
        run(tmp_path / "run", "--json", own)
    (tmp_path / "team.py").write_text("x = 1\n")
    with pytest.raises(
        ConfigError, match=r"team\.py: it already exists and does not have the name of a result"
    ):
        run(own, "--json", tmp_path / "team.py")
    assert own.read_bytes() == before
    assert (tmp_path / "team.py").read_text() == "x = 1\n"


def test_a_program_that_is_replayed_opens_no_robot_of_its_own(recorded: Path, tmp_path: Path) -> None:
    (tmp_path / "team.py").write_text(
        "from raccoon import open_robot\nwith open_robot() as robot:\n    pass\n"
    )
    with pytest.raises(ConfigError, match=r"must not open a robot: write what it does in mission\(robot\)"):
        run(recorded, "--program", tmp_path / "team.py")


def test_a_time_in_another_unit_is_told_as_the_diagnosis_tells_it(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It drove nowhere for hours, and nothing was said."""
    recording = recording_of(read_trace(recorded))
    for factor, unit in ((1.0, None), (100.0, None), (1e3, "milliseconds"), (1e6, "microseconds")):
        time = factor * recording["t"]
        write_csv(Recording({**recording.columns, "t": time}), tmp_path / "run.csv")
        run(tmp_path / "run.csv")
        shown = capsys.readouterr().out
        if unit is None:
            assert "it looks like" not in shown
            continue
        said = f"t advances by {5e-3 * factor:.3g} s a sample: it looks like {unit}, not seconds"
        assert said in shown
        with pytest.raises(TraceError, match=re.escape(said)):
            check_time(time)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("program", [False, True])
def test_whoever_waits_for_a_long_recording_is_told_how_far_it_is(
    program: bool, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("trace.format", "trace.columns", "trace.replay", "cli.replay.drive"):
        monkeypatch.setattr(f"raccoon.{module}.REPORT_PERIOD_CYCLES", 50)
    monkeypatch.setattr(sys, "stderr", screen := Terminal())
    script = tmp_path / "program.py"
    script.write_text(PROGRAM.format("seq(wait(0.2), straight(0.05))"))
    assert run(recorded, *(("--program", script) if program else ())) == 0
    lines = screen.getvalue().split("\r")
    count = len(read_trace(recorded).ticks)
    last = (
        f"replayed 50 of {count} cycles" if program else f"run.jsonl.gz: odometry over 50 of {count} cycles"
    )
    for said in ("reading run.jsonl.gz: 50 cycles", f"columns of 50 of {count} cycles", last):
        assert any(said in each for each in lines), said
    assert not lines[-2].strip()  # wiped out before what is found
