"""The odometry is set anew while something drives: places and headings of before are of another frame."""

import math
from typing import Any

import pytest

from raccoon import (
    Action,
    after_angle,
    after_distance,
    arc,
    deg,
    do,
    drive,
    drive_to,
    follow_line,
    follow_path,
    open_robot,
    race,
    seq,
    straight,
    turn,
    wait,
)
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Line, World
from robots import CONFIG, simulated_port, tophat_calibration

ELSEWHERE = (1.0, 0.5, 2.0)
"""x, y in m and heading in rad."""


def drive_beside_reset(action: Action[Any], port: SimPort) -> None:
    """Run an action that is set to another place after 1 s."""
    reset = seq(wait(1.0), do(lambda robot: robot.odometry.reset(*ELSEWHERE)), wait(60.0))
    with open_robot(CONFIG, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        robot.run(wait(0.3))
        try:
            robot.run(race(action, reset))
        finally:
            robot.run(wait(0.2))


@pytest.mark.parametrize(
    "action",
    [straight(0.5), turn(deg(170)), arc(0.2, deg(170)), drive_to(0.3, 0.0), follow_path([(0.3, 0.0)])],
)
def test_a_motion_to_a_goal_ends_and_the_robot_stands(action: Action[Any]) -> None:
    """Straight on for 0.5 m it went 0.3 m aside, and turned by 115 degrees."""
    port = simulated_port()
    with pytest.raises(RuntimeError, match=r"the odometry was reset on the way: do so between two motions"):
        drive_beside_reset(action, port)
    x, y, heading = port._robot.pose
    assert math.hypot(x, y) < 0.15
    assert abs(heading) < deg(100)
    assert port._robot.state.speed_left == pytest.approx(0.0, abs=0.01)


def test_a_drive_without_a_goal_goes_on_as_it_went() -> None:
    """It turned back to the heading and the line of before, in the new frame; and the distance that was set
    back counted as driven."""
    port = simulated_port()
    drive_beside_reset(drive(0.15).until(after_distance(0.3)), port)
    assert port._robot.pose == pytest.approx((0.31, 0.0, 0.0), abs=0.01)


def test_the_angle_that_is_set_anew_is_not_turned() -> None:
    port = simulated_port()
    drive_beside_reset(drive(0.1, 0.5).until(after_angle(1.0)), port)
    assert port._robot.pose[2] == pytest.approx(1.0, abs=0.05)


def test_a_line_is_followed_on() -> None:
    port = simulated_port(world=World(lines=(Line(((-0.5, 0.0), (3.0, 0.0))),)), start=(0.0, -0.005, 0.0))
    drive_beside_reset(follow_line("left", "left", 0.15).until(after_distance(0.5)), port)
    x, y, heading = port._robot.pose
    assert x == pytest.approx(0.5, abs=0.02)
    assert y == pytest.approx(-0.005, abs=0.003)
    assert abs(heading) < deg(1)
