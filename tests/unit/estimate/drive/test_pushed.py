"""A robot that is turned by a push while its wheels roll on: either wheel may be blamed for it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from drive_traces import Errors, drive
from raccoon.core.config import RobotConfig
from raccoon.estimate.drive.odometry import Odometry


@pytest.mark.parametrize("push", [1.2, -1.2])
def test_a_push_that_turns_the_robot_leaves_a_pose_within_its_deviation(push: float) -> None:
    odometry, x, y, heading, pushed, before = Odometry(RobotConfig()), 0.0, 0.0, 0.0, 0.0, (0.0, 0.0)
    for inputs, command in drive([(1.5, 0.0, 0.0), (4.0, 0.18, 0.0), (0.5, 0.0, 0.0)]):
        gyro, truth = inputs.gyro, inputs.truth
        assert gyro is not None
        assert truth is not None
        if 3.0 <= inputs.time < 3.3:
            pushed += push * 0.005
            inputs = replace(inputs, gyro=(0.0, 0.0, gyro[2] + push / inputs.device.gyro_rad_s))
        way = math.dist((truth.x, truth.y), before)
        before = truth.x, truth.y
        heading = truth.heading + pushed
        x, y = x + way * math.cos(heading), y + way * math.sin(heading)
        estimate = odometry.update(inputs, command)
    off = np.array([estimate.x - x, estimate.y - y, estimate.heading - heading])
    deviations = math.sqrt(float(off @ np.linalg.solve(odometry.pose_covariance, off)))
    assert deviations < 3.8  # 99.8 % of three values


@pytest.mark.parametrize("side", ["left", "right"])
def test_in_a_turn_on_the_spot_nobody_knows_which_wheel_slips(side: str) -> None:
    """As where a corner of the robot is at a wall: both wheels read too much, each its own way."""
    odometry = Odometry(RobotConfig())
    turn = [(1.5, 0.0, 0.0), (1.5, 0.0, 1.4), (0.5, 0.0, 0.0)]
    for inputs, command in drive(turn, Errors(slip=(2.0, 2.6, side, 0.6))):
        estimate = odometry.update(inputs, command)
    assert inputs.truth is not None
    off = math.hypot(estimate.x - inputs.truth.x, estimate.y - inputs.truth.y)
    assert math.hypot(estimate.x, estimate.y) < 0.002  # in the middle between the two
    assert off > 0.01
    assert math.hypot(estimate.x_std, estimate.y_std) == pytest.approx(
        off, rel=0.2
    )  # half of their difference
