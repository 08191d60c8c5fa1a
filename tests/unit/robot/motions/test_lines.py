"""Aligning on lines and walls, on tables drawn here."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from raccoon import (
    CalibrationError,
    MotionTimeout,
    Robot,
    after_distance,
    calibrate_drive,
    calibrate_tophats,
    deg,
    do,
    drive,
    follow_line,
    on_black,
    open_robot,
    race,
    repeat,
    seq,
    turn,
    wait,
)
from raccoon.core.config import BodyConfig, RobotConfig
from raccoon.core.readings import STOP, Inputs
from raccoon.robot.actions.actions import Action
from raccoon.robot.motions.driving import drive_until_stopped
from raccoon.robot.motions.lines import align_on_line
from raccoon.robot.motions.walls import align_on_wall
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Line, Wall, World
from robots import CONFIG, FULL_RATE, InterceptingPort, simulated_port, tophat_calibration


def on_table(
    world: World, start: tuple[float, float, float], action: Action[Any]
) -> tuple[Any, Robot, SimPort]:
    port = simulated_port(world=world, start=start)
    with open_robot(CONFIG, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        robot.run(wait(0.3))
        result = robot.run(action)
        robot.run(wait(0.1))
        return result, robot, port


@pytest.mark.parametrize(("askew_deg", "speed"), [(12.0, None), (-20.0, 0.15)])
def test_the_robot_stands_square_to_a_line(askew_deg: float, speed: float | None) -> None:
    world = World(lines=(Line(((0.3, -0.5), (0.3, 0.5))),))
    result, robot, _ = on_table(world, (0.0, 0.0, deg(askew_deg)), align_on_line("left", "right", speed))
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    assert math.degrees(robot.inputs.truth.heading) == pytest.approx(0.0, abs=0.8)
    assert abs(result.heading) < 0.01


def test_the_time_and_the_tolerance_of_an_alignment_are_those_that_were_asked_for() -> None:
    world = World(lines=(Line(((0.3, -0.5), (0.3, 0.5))),))
    with pytest.raises(MotionTimeout, match=r"drive not done after 1.0 s: 0.0\d\d of 0.5 m"):
        on_table(world, (0.0, 0.0, 0.0), align_on_line("left", "right", timeout=1.0))
    with pytest.raises(MotionTimeout, match=r"turn not done after 2.0 s"):
        on_table(world, (0.1, 0.0, deg(20)), align_on_line("left", "right", 0.2, tolerance=1e-9, timeout=2.0))


@pytest.mark.parametrize("exchanged", [True, False])
def test_sensors_in_each_others_port_are_said_where_the_line_lies_oddly_by_them(
    exchanged: bool, caplog: pytest.LogCaptureFixture
) -> None:
    def plugged(inputs: Inputs) -> Inputs:
        left, right, *others = inputs.analog
        return replace(inputs, analog=(right, left, *others) if exchanged else inputs.analog)

    world = World(lines=(Line(((0.2, -0.5), (0.2, 0.5))),))
    with open_robot(CONFIG, port=InterceptingPort(simulated_port(world=world), seen=plugged)) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        result = robot.run(seq(wait(0.5), turn(deg(8)), align_on_line("left", "right")))[-1]
    said = (
        "as left and right see it, the line lies 16 deg askew in the field, but parallel to its sides if "
        "their plugs are exchanged"
    )
    assert [said in each for each in result.remarks] == ([True] if exchanged else [])
    assert (said in caplog.text) is exchanged


@pytest.mark.parametrize(
    ("askew_deg", "further"),
    [
        (0.0, 0.0),
        (10.0, 0.02),
        (-20.0, 0.02),
        (40.0, 0.0),
    ],
)
def test_the_robot_stands_square_to_a_line_that_a_sensor_stands_on_already(
    askew_deg: float, further: float
) -> None:
    world = World(lines=(Line(((0.3, -0.5), (0.3, 0.5))),))
    first = "right" if askew_deg > 0.0 else "left"
    to_the_line = seq(drive(0.15).until(on_black(first)), drive(0.05).until(after_distance(further)))
    align = seq(to_the_line, align_on_line("left", "right"))
    results, robot, _ = on_table(world, (0.1, 0.0, deg(askew_deg)), align)
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    assert math.degrees(robot.inputs.truth.heading) == pytest.approx(0.0, abs=0.8)
    assert abs(results[-1].heading) < 0.01


def test_backwards_over_a_line_that_a_sensor_stands_on_already() -> None:
    world = World(lines=(Line(((-0.2, -0.5), (-0.2, 0.5))),))
    align = seq(drive(-0.15).until(on_black("left")), align_on_line("left", "right", -0.08))
    _, robot, _ = on_table(world, (0.1, 0.0, deg(12.0)), align)
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    assert math.degrees(robot.inputs.truth.heading) == pytest.approx(0.0, abs=0.8)


def test_the_edge_of_the_line_that_the_robot_came_along_is_not_that_of_the_crossing_one() -> None:
    """A sensor that crossed the stem of a T met another edge than the other one on its bar: 76 deg askew."""
    stem, bar = Line(((-0.5, 0.0), (0.5, 0.0)), width=0.05), Line(((0.5, -0.5), (0.5, 0.5)), width=0.05)
    align = seq(drive(0.15).until(on_black("left") | on_black("right")), align_on_line("left", "right"))
    _, robot, _ = on_table(World(lines=(stem, bar)), (0.0, -0.03, deg(8.0)), align)
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    assert robot.inputs.truth.x > 0.4
    assert math.degrees(robot.inputs.truth.heading) == pytest.approx(0.0, abs=1.5)


def test_a_line_that_lies_on_one_side_only_is_said() -> None:
    world = World(lines=(Line(((0.2, 0.0), (0.2, 0.5))),))
    with pytest.raises(MotionTimeout, match=r"no line at right within 0\.2 m, but one at left: .* junction"):
        on_table(world, (0.0, 0.0, 0.0), align_on_line("left", "right", reach=0.2))


def test_no_line_within_reach_is_said() -> None:
    with pytest.raises(MotionTimeout, match=r"no line at left and right within 0\.1 m"):
        on_table(World.empty(), (0.0, 0.0, 0.0), align_on_line("left", "right", reach=0.1))


@pytest.mark.parametrize(
    "motion",
    [
        align_on_line("left", "right", reach=0.2),
        follow_line("left", "left"),
        follow_line(left="left", right="right"),
    ],
)
def test_a_tophat_that_was_unplugged_is_named_where_no_line_is_found(motion: Action[Any]) -> None:
    full = InterceptingPort(simulated_port(), seen=lambda inputs: replace(inputs, analog=(4095,) * 6))
    with open_robot(CONFIG, port=full) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        with pytest.raises(
            MotionTimeout, match=r"line.*; tophat left reads the top of the scale .* plugged in"
        ):
            robot.run(seq(wait(0.5), motion))


def test_a_tophat_without_calibration_is_said() -> None:
    with (
        open_robot(CONFIG, port=simulated_port()) as robot,
        pytest.raises(CalibrationError, match="not calibrated"),
    ):
        robot.run(follow_line("left"))


def test_a_robot_that_cannot_move_gives_up_looking_for_a_line() -> None:
    with open_robot(CONFIG, port=InterceptingPort(sent=lambda _: STOP)) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        robot.run(wait(0.5))
        with pytest.raises(
            MotionTimeout, match=r"0\.000 of 0\.5 m; power but no motion at left \(motor port 0\)"
        ):
            robot.run(align_on_line("left", "right"))
        assert robot.time < 2.0


def test_a_robot_that_cannot_move_gives_up_calibrating() -> None:
    with open_robot(CONFIG, port=InterceptingPort(sent=lambda _: STOP)) as robot:
        for calibration in (calibrate_tophats, lambda each: calibrate_drive(each, lambda: 0.6)):
            begin = robot.time
            with pytest.raises(
                CalibrationError, match=r"failed: .*power but no motion at left \(motor port 0\)"
            ):
                calibration(robot)
            assert robot.time - begin < 3.0


def test_a_robot_that_is_far_too_slow_gives_up_as_well() -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(wait(0.5))
        begin = robot.time
        hindered = race(drive_until_stopped(0.15, 0.15), repeat(do(lambda each: each.drive.stop())))
        with pytest.raises(MotionTimeout, match=r"drive not done after 4\.\d s: 0\.000 of 0\.15 m"):
            robot.run(hindered)
        assert robot.time - begin == pytest.approx(2.0 * (0.15 / 0.15 + 0.15 / 0.4) + 2.0, abs=0.1)


@pytest.mark.parametrize(
    "make", [lambda: align_on_line("left", "right", 0.0), lambda: drive_until_stopped(0.0, 0.5)]
)
def test_a_line_is_not_looked_for_without_driving(make: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match="speed is 0: allowed are numbers above or below it"):
        make()


def _wall(askew: float, distance: float) -> World:
    """A wall ahead, or behind for a distance below 0, to which the heading `askew` rad is square."""
    x, y = distance * math.cos(askew), distance * math.sin(askew)
    along_x, along_y = -2.0 * math.sin(askew), 2.0 * math.cos(askew)
    return World(walls=(Wall((x - along_x, y - along_y), (x + along_x, y + along_y)),))


@pytest.mark.parametrize(
    ("askew_deg", "speed"), [(8.0, 0.06), (-8.0, -0.06), (-8.0, 0.15), (20.0, 0.06), (20.0, 0.15)]
)
def test_the_robot_squares_up_to_a_wall(askew_deg: float, speed: float) -> None:
    port = simulated_port(world=_wall(deg(askew_deg), math.copysign(0.17, speed)), config=FULL_RATE)
    with open_robot(FULL_RATE, port=port) as robot:
        robot.run(wait(0.3))
        result = robot.run(align_on_wall(speed, heading=deg(askew_deg), heading_std=0.01))
        x, y, heading = port._robot.pose
        assert math.degrees(heading) == pytest.approx(askew_deg, abs=0.5)
        here = robot.estimate
        # Both wheels spin at it until their momentum is spent.
        assert math.hypot(here.x - x, here.y - y) < 3.5 * math.hypot(here.x_std, here.y_std)
        assert here.heading == pytest.approx(heading, abs=deg(0.3))
        # What gyro and wheels said of the turn before the wall was believed.
        assert math.degrees(result.heading) == pytest.approx(0.0, abs=0.5)
        assert port._robot.state.speed_left == pytest.approx(0.0, abs=0.01)


def test_a_heading_of_a_wall_that_is_not_believed_is_said() -> None:
    with open_robot(CONFIG, port=simulated_port(world=_wall(0.0, 0.2))) as robot:
        robot.run(wait(0.5))
        result = robot.run(align_on_wall(heading=deg(30.0)))
        assert robot.estimate.heading == pytest.approx(0.0, abs=deg(1.0))
        (said,) = result.remarks
        assert said.startswith("align_on_wall: heading=30.0 deg is not used, the odometry is -30")
        assert said in robot.drive.remarks.values()


@pytest.mark.parametrize(("askew_deg", "speed"), [(5.0, 0.08), (8.0, 0.1), (7.0, -0.08)])
def test_a_wheel_that_slips_at_a_wall_is_no_wheel_of_another_size(askew_deg: float, speed: float) -> None:
    """Scales that nobody calibrated learn from a turn, but not from one in which a wheel slips."""
    config = RobotConfig()
    port = SimPort(Parameters.from_robot(config), _wall(deg(askew_deg), math.copysign(0.2, speed)))
    with open_robot(config, port=port) as robot:
        robot.run(wait(1.0))
        robot.run(align_on_wall(speed))
        x, y, _ = port._robot.pose
        here = robot.estimate
        assert math.hypot(here.x - x, here.y - y) < 2.0 * math.hypot(here.x_std, here.y_std)


def test_wheels_that_spin_at_a_wall_are_said_as_well() -> None:
    slippery = replace(CONFIG, body=BodyConfig(mass=1.0, grip=0.5))
    port = simulated_port(world=_wall(0.0, 0.12), config=slippery)
    with (
        open_robot(slippery, port=port) as robot,
        pytest.raises(MotionTimeout, match=r"no wall after 2 s: .* or spinning at it"),
    ):
        robot.run(align_on_wall(timeout=2.0))


@pytest.mark.parametrize("port", ["sim", "emulator"])
def test_no_wall_is_said(port: str) -> None:
    config = replace(CONFIG, controller=replace(CONFIG.controller, port=port))
    with (
        open_robot(config) as robot,
        pytest.raises(
            MotionTimeout,
            match=r"wheels still turn after 0.0\d m, on the way to the wall \(allow a longer timeout=",
        ),
    ):
        robot.run(align_on_wall(timeout=1.0))
