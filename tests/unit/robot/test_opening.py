"""robot.toml names the port, and nothing else is opened in its place."""

import math
import re
import runpy
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest

from raccoon import RobotConfig, deg, open_robot, replay, seq, straight, turn, wait
from raccoon.core.config import ControllerConfig, TophatConfig
from raccoon.core.errors import HardwareError
from raccoon.core.readings import Inputs
from raccoon.robot.opening import open_port
from raccoon.trace.format import read_trace
from robots import InterceptingPort, simulated_port
from unit.trace.recordings import ScriptedPort

MISSION = seq(wait(0.5), straight(0.10), turn(deg(45)))


@pytest.mark.parametrize("kind", ["sim", "emulator", "emulator-raccoon"])
def test_one_mission_runs_on_the_simulator_and_on_both_emulated_firmwares(kind: str) -> None:
    config = RobotConfig(controller=ControllerConfig(port=kind))
    with open_robot(config, seed=2) as robot:
        robot.run(MISSION)
        assert robot.pose.x == pytest.approx(0.10, abs=0.005)
        assert math.degrees(robot.pose.heading) == pytest.approx(45.0, abs=0.5)


@pytest.mark.parametrize("kind", ["wombat", "wombat-raccoon", "create"])
def test_missing_hardware_is_an_error_not_a_simulation(kind: str) -> None:
    config = RobotConfig(controller=ControllerConfig(port=kind))
    with pytest.raises((HardwareError, ImportError)), open_robot(config):
        pass  # pragma: no cover - there is no such controller here


def test_the_path_of_robot_toml_is_opened() -> None:
    config = RobotConfig(controller=ControllerConfig(port="create", device="/dev/not-plugged-in"))
    with pytest.raises(HardwareError, match="/dev/not-plugged-in"), open_robot(config):
        pass  # pragma: no cover - there is no such device


def test_a_run_is_recorded_where_asked(tmp_path: Path) -> None:
    config = RobotConfig(controller=ControllerConfig(port="sim"))
    with open_robot(config, record=tmp_path / "run") as robot:
        robot.run(wait(0.05))
        robot.note("halfway")
        robot.run(wait(0.05))
    assert [path.name for path in tmp_path.iterdir()] == ["run.jsonl.gz"]
    assert read_trace(tmp_path / "run.jsonl.gz").header.seed == 0  # with which the same run comes again


def test_a_reading_that_is_asked_for_before_there_is_one_says_how_to_get_it() -> None:
    config = RobotConfig(controller=ControllerConfig(port="sim"))
    for ticks, noted in ((0, True), (1, False)):
        with pytest.raises(TypeError) as caught:
            _reckon_with_nothing(config, ticks)
        assert ("robot.run(wait(0.1))" in "".join(getattr(caught.value, "__notes__", ()))) is noted


def test_a_name_that_a_result_does_not_have_is_answered_by_those_it_has() -> None:
    config = RobotConfig(controller=ControllerConfig(port="sim"))
    with pytest.raises(AttributeError) as caught, open_robot(config) as robot:
        print(robot.pose.theta)  # type: ignore[attr-defined]
    assert re.fullmatch(r"a Pose has .*heading, .*x, y", caught.value.__notes__[0])


def _reckon_with_nothing(config: RobotConfig, ticks: int) -> None:
    with open_robot(config) as robot:
        for _ in range(ticks):
            robot.tick()
        robot.analog(0) + None  # type: ignore[operator]


def test_a_program_that_runs_nothing_is_told(caplog: pytest.LogCaptureFixture) -> None:
    """Actions that were made and not run did nothing, without a word."""
    config = RobotConfig(controller=ControllerConfig(port="sim"))
    with open_robot(config):
        kept = [wait(0.05)]
    assert kept
    assert [each.message for each in caplog.records] == [
        "the program ran nothing on the robot: run an action with robot.run(...)"
    ]
    with open_robot(config) as robot:
        robot.run(wait(0.05))
    with pytest.raises(KeyError), open_robot(config):
        raise KeyError
    assert len(caplog.records) == 1


def test_the_second_run_is_recorded_beside_the_first(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    config = RobotConfig(controller=ControllerConfig(port="sim"))
    for ticks in (3, 5):
        with open_robot(config, record=tmp_path / "match") as robot:
            for _ in range(ticks):
                robot.tick()
    assert {path.name: len(read_trace(path).ticks) for path in tmp_path.iterdir()} == {
        "match.jsonl.gz": 3,
        "match-2.jsonl.gz": 5,
    }
    [said] = caplog.messages
    assert said.endswith("this run is written to " + str(tmp_path / "match-2.jsonl.gz"))


def test_a_robot_drives_without_a_recording_where_none_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    config = RobotConfig(controller=ControllerConfig(port="sim"))
    with ExitStack() as leaving:
        with pytest.warns(RuntimeWarning, match="is not recorded, the run goes on"):
            robot = leaving.enter_context(open_robot(config, record=tmp_path / "file" / "match"))
        robot.run(straight(0.01))
        assert robot.pose.x == pytest.approx(0.01, abs=0.003)


def test_a_robot_is_opened_anew_for_each_block() -> None:
    opening = open_robot(RobotConfig(controller=ControllerConfig(port="sim")))
    with opening as robot:
        robot.tick()
    with pytest.raises(
        RuntimeError, match=r"already been opened: write `with open_robot\(\.\.\.\) " r"as robot:`"
    ):
        opening.__enter__()


def test_the_port_is_closed_where_the_robot_cannot_be_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_given: object, **_more: object) -> None:
        raise MemoryError

    monkeypatch.setattr("raccoon.trace.record.RecordingPort", broken)
    port = ScriptedPort([])
    with pytest.raises(MemoryError), open_robot(RobotConfig(), port=port, record=tmp_path / "run"):
        pass  # pragma: no cover - it is not opened
    assert port.closed


PROGRAM = """
from raccoon import load_robot, open_robot
with open_robot("robot.toml") as robot:
    assert load_robot("robot.toml") == robot.config
    print(robot.config.name)
"""


def test_robot_toml_may_lie_beside_a_program_that_is_started_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def started(program: Path, folder: Path) -> str:
        """What a program says that is started from a folder, or how it ends."""
        monkeypatch.chdir(folder)
        try:
            runpy.run_path(str(program), run_name="__main__")
        except OSError as error:
            return f"{type(error).__name__}: {error}"
        return capsys.readouterr().out.strip()

    team, other = tmp_path / "our team", tmp_path / "elsewhere"
    for folder in (team, other):
        folder.mkdir()
    program = team / "program.py"
    program.write_text(PROGRAM)
    for folder in (team, other):
        (folder / "robot.toml").write_text(f'name = "{folder.name}"\n[controller]\nport = "sim"\n')
    assert started(program, other) == "elsewhere"
    (other / "robot.toml").unlink()
    assert started(program, other) == "our team"
    (team / "robot.toml").unlink()
    assert started(program, other) == (
        f"FileNotFoundError: there is no robot.toml in {other} (where the program was started), and none "
        f"beside the program in {team}; `raccoon init` writes a template"
    )
    assert started(program, team) == (
        f"FileNotFoundError: there is no robot.toml in {team} (where the program was started); `raccoon "
        "init` writes a template"
    )


@pytest.mark.parametrize("kind", ["wombat", "wombat-raccoon", "emulator", "emulator-raccoon"])
def test_the_ports_of_the_tophats_are_watched_for_the_ends_of_their_range(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched: list[object] = []

    def opened(*_: object, watch_analog: list[int], **__: object) -> ScriptedPort:
        watched.append(watch_analog)
        return ScriptedPort(())

    monkeypatch.setattr("raccoon.hal.wombat.port.open_wombat", opened)
    monkeypatch.setattr("raccoon.robot.emulated.WombatPort", opened)
    tophats = {"left": TophatConfig(3, 0.1, 0.03), "right": TophatConfig(1, 0.1, -0.03)}
    open_port(RobotConfig(controller=ControllerConfig(port=kind), tophats=tophats))
    assert watched == [[3, 1]]


def test_a_port_of_a_programs_own_that_gives_no_readings_or_no_time_is_told() -> None:
    nothing: Any = InterceptingPort(simulated_port(), seen=lambda _: cast(Inputs, None))
    no_readings = pytest.raises(
        TypeError, match=r"read\(\) of InterceptingPort returns None: it must return Inputs"
    )
    with open_robot(RobotConfig(), port=nothing) as robot, no_readings:
        robot.tick()
    short = InterceptingPort(simulated_port(), seen=lambda inputs: replace(inputs, bemf=(1.0,)))
    too_few = pytest.raises(
        ValueError, match=r"bemf of the port's Inputs is \(1.0,\): it must be a tuple of 4"
    )
    with open_robot(RobotConfig(), port=short) as robot, too_few:
        robot.tick()
    stopped = InterceptingPort(simulated_port(), seen=lambda inputs: replace(inputs, time=5.0))
    no_time = pytest.raises(HardwareError, match=r"time has stood still at 5.0 s for 1000 readings")
    with open_robot(RobotConfig(), port=stopped) as robot, no_time:
        robot.run(wait(1.0))
    assert not any(stopped.written[-1].duty)


def test_what_is_no_name_of_a_recording_is_refused_by_its_name() -> None:
    anything: Any = straight(0.1)
    for nameless in ("", ".", Path("/")):
        with pytest.raises(
            ValueError, match=r"record is '.?': it must be the name of a recording, such as 'run'"
        ):
            open_robot(record=nameless)
    with pytest.raises(TypeError, match=r"record is <Action straight 0.1 m>: it must be the name of a rec"):
        open_robot(RobotConfig(), port=simulated_port(), record=anything)
    with pytest.raises(TypeError, match=r"trace is <Action straight 0.1 m>: it must be the name of a recor"):
        replay(anything, straight(0.1))
    with pytest.raises(TypeError, match=r"tolerance is <Action straight 0.1 m>: it must be a number, from 0"):
        replay("run", straight(0.1), tolerance=anything)
