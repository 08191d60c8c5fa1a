"""What runs in the background: for how long, and that nothing is left driving between two runs."""

from __future__ import annotations

from contextlib import suppress

import pytest

from raccoon import (
    Action,
    HardwareError,
    MotionTimeout,
    Robot,
    RobotConfig,
    after_time,
    background,
    do,
    drive,
    move,
    open_robot,
    repeat,
    run_match,
    seq,
    spin,
    wait,
)
from raccoon.core.config import MechanismConfig
from raccoon.core.readings import Inputs
from raccoon.robot.actions.actions import Steps
from robots import CONFIG, InterceptingPort, endless_action, simulated_port

ARM = RobotConfig(motors=CONFIG.motors, mechanisms={"arm": MechanismConfig(motor=2)})


def counting(counts: list[float]) -> Action[None]:
    """Puts the time into `counts`, every 0.1 s."""
    return repeat(seq(do(lambda robot: counts.append(robot.time)), wait(0.1)))


@pytest.mark.parametrize(
    ("moving", "port"),
    [(drive(0.2), 0), (drive(0.0, 1.0), 1), (spin("arm", 2.0), 2), (move("arm", 6.0), 2)],
    ids=repr,
)
def test_what_moves_in_the_background_stands_between_two_runs(moving: Action[object], port: int) -> None:
    with open_robot(ARM, port=simulated_port(config=ARM)) as robot:
        robot.run(seq(background(moving), wait(0.5)))
        assert robot.outputs.duty == (0.0,) * 4
        assert robot.outputs.brake[port]
        robot.run(wait(0.1).until(after_time(0.05)))
        assert robot.outputs.duty == (0.0,) * 4
        for _ in range(20):
            robot.tick()
        assert abs(robot.outputs.duty[port]) > 0.05  # it goes on with the ticks


def test_an_action_that_ends_with_a_command_leaves_nothing_driving() -> None:
    def hasty(robot: Robot) -> Steps[None]:
        yield
        robot.drive.duties(0.5, 0.5)

    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(Action("hasty", hasty))
        assert robot.outputs.duty == (0.0,) * 4


def test_the_background_goes_on_after_a_timeout_that_the_program_catches() -> None:
    counts: list[float] = []
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(background(counting(counts)))
        with pytest.raises(MotionTimeout, match=r"not done after 0\.5 s \(the wheels are not driven\)"):
            robot.run(wait(5.0).timeout(0.5))
        caught = len(counts)
        robot.run(wait(1.0))
        assert len(counts) == pytest.approx(caught + 10, abs=1)


def test_one_that_fails_does_not_end_the_others() -> None:
    counts: list[float] = []
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(seq(background(wait(0.2).timeout(0.1)), background(counting(counts))))
        with pytest.raises(MotionTimeout):
            robot.run(wait(1.0))
        caught = len(counts)
        robot.run(wait(1.0))
        assert len(counts) == pytest.approx(caught + 10, abs=1)


def bug(_robot: Robot) -> None:
    raise KeyError("pom")


def raise_interrupt(_robot: Robot) -> None:
    raise KeyboardInterrupt


def test_the_background_ends_with_the_program() -> None:
    counts: list[float] = []
    ended: list[str] = []
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(background(counting(counts)))
        with pytest.raises(KeyboardInterrupt):
            robot.run(seq(wait(0.2), do(raise_interrupt)))
        caught = len(counts)
        robot.run(seq(background(endless_action(ended, "by its end")), wait(0.2)))
        assert len(counts) == caught
    assert ended == ["by its end"]


@pytest.mark.parametrize("program", [wait(0.2), wait(5.0), do(bug)], ids=["ends", "late", "bug"])
def test_the_background_ends_with_the_match(program: Action[object]) -> None:
    ended: list[str] = []

    with open_robot(CONFIG, port=simulated_port()) as robot:
        with suppress(KeyError):
            run_match(robot, seq(background(endless_action(ended, "ended")), wait(0.1), program), seconds=1.0)
        assert ended == ["ended"]


class Unreliable(InterceptingPort):
    """The simulated robot, whose cable falls out when a test says so."""

    broken = False

    def read(self) -> Inputs:
        if self.broken:
            raise HardwareError("the cable fell out")
        return super().read()


def test_a_tick_that_fails_stops_the_motors() -> None:
    port = Unreliable()
    with open_robot(CONFIG, port=port) as robot:
        robot.add_background(drive(0.2))
        for _ in range(50):
            robot.tick()
        assert port.written[-1].duty[0] > 0.0
        port.broken = True
        with pytest.raises(HardwareError, match="the cable fell out"):
            robot.tick()
        assert port.written[-1].duty == (0.0,) * 4
    with pytest.raises(HardwareError, match="the robot is closed"):
        robot.tick()


def test_one_that_cannot_be_ended_keeps_no_motor_on() -> None:
    ended: list[str] = []

    port = Unreliable()
    with open_robot(CONFIG, port=port) as robot:
        for _ in range(2):
            robot.add_background(endless_action(ended, "bad", KeyError("while it was ended")))
        with pytest.raises(KeyError, match="while it was ended"):
            robot.run(seq(drive(0.2).until(after_time(0.3)), do(raise_interrupt)))
        assert ended == ["bad", "bad"]
        assert port.written[-1].duty == (0.0,) * 4
