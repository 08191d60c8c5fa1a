"""A gyro whose bias becomes another one while the robot drives: what that has turned is in doubt."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from drive_traces import PER_COUNT, RADIUS, TRACK, Errors, Segment, drive
from raccoon.core.config import RobotConfig
from raccoon.core.readings import Inputs, Outputs
from raccoon.estimate.drive.estimate import DriveEstimate
from raccoon.estimate.drive.odometry import Odometry, OdometrySettings

REST: Segment = (1.0, 0.0, 0.0)
QUIET = Errors(bemf_noise_counts=0.0, gyro_noise=0.0, slip_noise=0.0)
DRIVE: list[Segment] = [(1.5, 0.18, 0.0), (0.2, 0.0, 0.0), (1.0, 0.0, 1.6), (0.2, 0.0, 0.0), (1.5, 0.18, 0.0)]


def read(
    jump: float, at: float, *, every: int = 1, segments: list[Segment] = DRIVE
) -> Iterator[tuple[Inputs, Outputs]]:
    """The cycles of a drive in which the bias jumps by rad/s at s."""
    for inputs, command in drive([REST, *segments, (2.0, 0.0, 0.0)], seed=3, gyro_every=every):
        if inputs.time > at and inputs.gyro is not None:
            word = inputs.gyro[2] + jump / inputs.device.gyro_rad_s
            inputs = replace(inputs, gyro=(inputs.gyro[0], inputs.gyro[1], word))
        yield inputs, command


def driven(
    jump: float, at: float, *, every: int = 1, segments: list[Segment] = DRIVE
) -> tuple[DriveEstimate, float, float]:
    """The end of a drive in which the bias jumps by rad/s at s; errors of the heading and of the place."""
    odometry = Odometry(RobotConfig(), settings=OdometrySettings(uncalibrated_gyro_scale=0.001))
    for inputs, command in read(jump, at, every=every, segments=segments):
        estimate = odometry.update(inputs, command)
    truth = inputs.truth
    assert truth is not None
    place = math.hypot(estimate.x - truth.x, estimate.y - truth.y)
    return estimate, abs(estimate.heading - truth.heading), place


@pytest.mark.parametrize(
    ("jump", "at", "every"), [(0.02, 1.1, 1), (0.02, 1.1, 4), (0.02, 3.0, 4), (-0.03, 2.0, 4), (0.01, 3.0, 1)]
)
def test_what_another_bias_has_turned_is_in_doubt(jump: float, at: float, every: int) -> None:
    estimate, turned, moved = driven(jump, at, every=every)
    assert turned < 2.5 * estimate.heading_std
    assert moved < 2.5 * math.hypot(estimate.x_std, estimate.y_std)
    assert estimate.gyro_bias == pytest.approx(jump, abs=0.001)


@pytest.mark.parametrize("jump", [0.0, 0.0005])
def test_a_bias_that_drifts_as_gyros_do_is_no_doubt(jump: float) -> None:
    estimate, _, _ = driven(jump, 2.0)
    assert estimate.heading_std < 0.003


@pytest.mark.parametrize("bias", [0.0, 0.005, 0.01])
def test_a_bias_that_was_there_from_the_beginning_is_no_jump(bias: float) -> None:
    """Nor is it told again in a long rest."""
    estimate, turned, _ = driven(bias, 0.0, segments=[(4.0, 0.0, 0.0)])
    assert estimate.heading_std < 0.001
    assert turned < 0.003


def test_the_doubt_stays_where_something_is_seen_late() -> None:
    """Steps that are taken again are taken with it. What is seen says next to nothing of the heading."""
    alone, seen = Odometry(RobotConfig()), Odometry(RobotConfig())
    doubted = 0.0
    for inputs, command in read(0.02, 1.5, segments=DRIVE[:1]):
        before = alone.estimate.heading_std
        for each in (alone, seen):
            each.update(inputs, command)
        if alone.estimate.heading_std > 2.0 * before > 0.001:
            doubted = inputs.time
        if doubted and inputs.time == pytest.approx(doubted + 0.2):
            assert seen.observe_heading(seen.estimate.heading, 1.0, time=doubted - 0.1).accepted
    assert doubted > 0.0
    assert seen.estimate.heading == pytest.approx(alone.estimate.heading, abs=1e-4)
    assert seen.estimate.heading_std == pytest.approx(alone.estimate.heading_std, rel=1e-3)


def test_a_reset_ends_what_another_bias_has_turned() -> None:
    """A robot that is put down as soon as it stands heads as it was put down."""
    odometry = Odometry(RobotConfig())
    for inputs, command in read(0.02, 1.5, segments=[(3.0, 0.18, 0.0)]):
        odometry.update(inputs, command)
        if inputs.time == pytest.approx(4.3):
            odometry.reset()
    assert odometry.estimate.gyro_bias == pytest.approx(0.02, abs=0.001)
    assert abs(odometry.estimate.heading) < 2.5 * odometry.estimate.heading_std < math.radians(1.5)


def test_wheels_and_gyro_that_read_a_turn_at_rest_leave_the_same_doubt_to_either_side() -> None:
    """A controller whose offsets and bias both change as the robot comes to rest."""
    ends = []
    for turn in (0.06, -0.06):
        odometry = Odometry(RobotConfig())
        aside = turn * 0.5 * TRACK / RADIUS / PER_COUNT
        for inputs, command in drive([(0.5, 0.0, 0.0), (0.25, 0.15, 0.0), (1.4, 0.0, 0.0)], QUIET, dt=0.01):
            if inputs.time > 0.75:
                left, right = inputs.bemf[0] or 0.0, inputs.bemf[1] or 0.0
                inputs = replace(
                    inputs,
                    gyro=(0.0, 0.0, turn / inputs.device.gyro_rad_s),
                    bemf=(left - aside, right + aside, None, None),
                    position=(None,) * 4,
                )
            estimate = odometry.update(inputs, command)
        ends.append(estimate)
    one, other = ends
    assert one.heading == pytest.approx(-other.heading, rel=1e-6)
    assert one.heading_std == pytest.approx(other.heading_std, rel=1e-6)
    assert one.heading_std > 0.02
