"""A recorded run, replayed, is the same run; a changed program is caught where it differs."""

from pathlib import Path
from typing import Any

import pytest

from raccoon import (
    MotionTimeout,
    ReplayDiverged,
    Robot,
    RobotConfig,
    deg,
    open_robot,
    replay,
    seq,
    straight,
    turn,
    wait,
)
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World


def mission(robot: Robot) -> tuple[float, float, float]:
    robot.run(seq(wait(0.2), straight(0.05), turn(deg(20))))
    return robot.pose.x, robot.pose.y, robot.pose.heading


def changed(robot: Robot) -> None:
    robot.run(seq(wait(0.2), straight(0.06), turn(deg(20))))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[float, float, float]]:
    path = tmp_path_factory.mktemp("recorded") / "run.jsonl.gz"
    config = RobotConfig()
    port = SimPort(Parameters.from_robot(config), World.empty(), robot=config, seed=3)
    with open_robot(config, port=port, record=path, seed=3) as robot:
        return path, mission(robot)


def test_estimates_are_identical_to_the_last_bit(
    recorded: tuple[Path, tuple[float, float, float]],
) -> None:
    path, end = recorded
    assert replay(path, mission) == end


def test_a_changed_program_diverges_at_a_named_tick_and_field(
    recorded: tuple[Path, tuple[float, float, float]],
) -> None:
    with pytest.raises(ReplayDiverged, match=r"tick \d+: motor\.0\.duty was .* in the recording") as caught:
        replay(recorded[0], changed)
    assert caught.value.tick > 40  # the wait is the same


def test_a_changed_program_may_run_on_old_readings_where_asked(
    recorded: tuple[Path, tuple[float, float, float]],
) -> None:
    with pytest.raises(EOFError, match="the recording has ended"):
        replay(recorded[0], changed, check=False)


def test_recorded_readings_say_nothing_of_the_motors_under_other_commands(
    recorded: tuple[Path, tuple[float, float, float]],
) -> None:
    def other(robot: Robot) -> Robot:
        with pytest.raises(
            MotionTimeout, match=r"the readings are from a recording and do not follow these commands$"
        ):
            robot.run(straight(1.0, timeout=1.0))
        return robot

    assert replay(recorded[0], other, check=False).drive.remarks == {}


def test_two_simulated_runs_from_one_seed_are_the_same() -> None:
    config = RobotConfig()
    ends = []
    for _ in range(2):
        port = SimPort(Parameters.from_robot(config), World.empty(), robot=config, seed=5)
        with open_robot(config, port=port) as robot:
            ends.append(mission(robot))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("name", ["run", "run.jsonl"])
def test_the_name_that_it_was_recorded_under_finds_it(
    recorded: tuple[Path, tuple[float, float, float]], name: str
) -> None:
    path, end = recorded
    assert replay(path.with_name(name), mission) == end


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ([wait(0.2)], r"replay\(\) takes one action, not a list of them: write seq\(\*actions\)"),
        (None, r"replay\(\) takes a function of the robot, not None"),
        (lambda: 1, r"replay\(\) takes a function of the robot, not <lambda>\(\)"),
    ],
)
def test_what_is_no_program_is_refused_before_the_recording_is_read(program: Any, said: str) -> None:
    with pytest.raises(TypeError, match=said):
        replay("there-is-none.jsonl.gz", program)
