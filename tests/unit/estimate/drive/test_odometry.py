"""What the odometry reaches on a small kinematic robot with known truth."""

import math
from dataclasses import replace
from typing import Any

import pytest

from drive_traces import Errors, Segment, drive
from raccoon.core.config import RobotConfig
from raccoon.core.readings import Status, Truth
from raccoon.estimate.drive.odometry import DriveEstimate, Odometry

SQUARE: list[Segment] = [(3.0, 0.0, 0.0)] + [(2.0, 0.2, 0.0), (1.5, 0.0, 1.1), (1.0, 0.0, 0.0)] * 4


def final(segments: list[Segment], errors: Errors, **more: Any) -> tuple[DriveEstimate, Truth]:
    odometry = Odometry(RobotConfig())
    for inputs, command in drive(segments, errors, **more):
        estimate = odometry.update(inputs, command)
    assert inputs.truth is not None
    return estimate, inputs.truth


def test_square_is_followed_and_the_truth_lies_within_four_sigma() -> None:
    estimate, truth = final(SQUARE, Errors())
    assert abs(estimate.heading - truth.heading) < min(math.radians(1.0), 4 * estimate.heading_std)
    assert abs(estimate.x - truth.x) < min(0.01, 4 * estimate.x_std)
    assert abs(estimate.y - truth.y) < min(0.01, 4 * estimate.y_std)
    assert estimate.status is Status.OK


def test_offsets_and_bias_are_learnt_while_it_waits() -> None:
    errors = Errors(offset_counts=(31.5, -54.9), gyro_bias=0.004)
    estimate, truth = final(SQUARE, errors)
    assert estimate.gyro_bias == pytest.approx(0.004, abs=4 * estimate.gyro_bias_std)
    assert abs(estimate.heading - truth.heading) < math.radians(1.0)
    assert math.hypot(estimate.x - truth.x, estimate.y - truth.y) < 0.01


def test_wheel_speeds_follow_without_the_lag_of_the_board() -> None:
    odometry = Odometry(RobotConfig())
    worst = 0.0
    for inputs, command in drive([(1.0, 0.0, 0.0), (0.5, 0.2, 0.0)], Errors(bemf_noise_counts=0.5)):
        estimate = odometry.update(inputs, command)
        if 1.05 < inputs.time < 1.2:
            true = 0.8 * (inputs.time - 0.995) / 0.0345
            worst = max(worst, abs(estimate.left_speed - true))
    # The board's own filter would be 0.8 / 0.0345 * 0.0225 = 0.52 rad/s behind.
    assert worst < 0.3


def test_distance_is_signed() -> None:
    estimate, _ = final([(1.0, 0.0, 0.0), (2.0, 0.2, 0.0), (2.0, -0.2, 0.0), (1.0, 0.0, 0.0)], Errors())
    assert estimate.distance == pytest.approx(0.05, abs=0.005)  # the turn-round happens 0.05 m ahead
    forward, _ = final([(1.0, 0.0, 0.0), (2.25, 0.2, 0.0), (1.0, 0.0, 0.0)], Errors())
    assert forward.distance == pytest.approx(0.45, rel=0.02)


@pytest.mark.parametrize(
    "sensors",
    [
        {"counters": False},
        {"bemf": False},
        {"gyro_every": 4},
        {"gyro_every": 0},
        {"gyro_every": 4, "bemf": False},
    ],
)
def test_missing_sensors_cost_accuracy_not_consistency(sensors: dict[str, Any]) -> None:
    estimate, truth = final(SQUARE[:7], Errors(), **sensors)  # two sides
    assert abs(estimate.heading - truth.heading) < 4 * estimate.heading_std
    assert math.hypot(estimate.x - truth.x, estimate.y - truth.y) < 4 * math.hypot(
        estimate.x_std, estimate.y_std
    )


def test_reset_moves_the_pose_and_keeps_what_was_learnt() -> None:
    odometry = Odometry(RobotConfig(), x=1.0, y=2.0, heading=3.0)
    assert (odometry.estimate.x, odometry.estimate.y, odometry.estimate.heading) == (1.0, 2.0, 3.0)
    for inputs, command in drive([(2.0, 0.0, 0.0)], Errors(gyro_bias=0.004)):
        odometry.update(inputs, command)
    learnt = odometry.estimate.gyro_bias
    odometry.reset(0.5, 0.0, -1.0)
    assert (odometry.estimate.x, odometry.estimate.heading) == (0.5, -1.0)
    assert odometry.estimate.gyro_bias == learnt
    assert learnt == pytest.approx(0.004, abs=0.001)


def test_a_pose_that_is_not_finite_and_deviations_that_are_none_are_refused() -> None:
    odometry = Odometry(RobotConfig())
    before = odometry.resets
    for pose in ((math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.nan)):
        with pytest.raises(ValueError, match="must be finite"):
            odometry.reset(*pose)
    for std in (-0.01, math.nan, math.inf):
        with pytest.raises(ValueError, match=f"position_std is {std}: allowed are finite numbers from 0"):
            odometry.reset(position_std=std)
        with pytest.raises(ValueError, match=f"heading_std is {std}: allowed are finite numbers from 0"):
            odometry.reset(heading_std=std)
    assert odometry.resets == before


def test_a_device_that_is_said_anew_is_the_same_one() -> None:
    """As of a recording whose cycles each have their own: what was learnt of wheels and gyro stays."""
    once, anew = Odometry(RobotConfig()), Odometry(RobotConfig())
    for inputs, command in drive([(0.6, 0.0, 0.0), (0.6, 0.1, 0.5)], Errors(gyro_bias=0.01)):
        once.update(inputs, command)
        anew.update(replace(inputs, device=replace(inputs.device)), command)
    assert anew.estimate == once.estimate


def test_the_first_estimate_is_of_the_first_cycle() -> None:
    """A port's clock seldom begins at 0. And what is seen at once is of now."""
    odometry = Odometry(RobotConfig())
    inputs, command = next(drive([(0.1, 0.0, 0.0)]))
    estimate = odometry.update(replace(inputs, time=1000.0), command)
    assert (estimate.time, estimate.reasons) == (1000.0, ())
    assert odometry.observe_heading(0.0, std=0.1, time=1000.0).accepted


@pytest.mark.parametrize(
    ("position_std", "heading_std", "status", "told"),
    [
        (0.0, 0.0, Status.OK, ()),
        (0.08, 0.0, Status.UNCERTAIN, ("the position is uncertain by 0.1 m or more: drive to a wall",)),
        (0.0, 0.1, Status.UNCERTAIN, ("the heading is uncertain by 5 degrees or more: align_on_wall",)),
        (
            2.0,
            2.0,
            Status.INVALID,
            ("the position is uncertain by 0.1 m", "the heading is uncertain by 5 deg"),
        ),
    ],
)
def test_an_estimate_that_is_less_than_ok_says_why(
    position_std: float, heading_std: float, status: Status, told: tuple[str, ...]
) -> None:
    """Also where nothing but its deviation says so, long after what it came from."""
    odometry = Odometry(RobotConfig())
    odometry.reset(position_std=position_std, heading_std=heading_std)
    assert odometry.estimate.status is status
    assert len(odometry.estimate.reasons) == len(told)
    assert all(each.startswith(begin) for each, begin in zip(odometry.estimate.reasons, told, strict=True))
