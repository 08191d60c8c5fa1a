"""Something seen late: the steps since then are taken again, and change nothing that is of now."""

import numpy as np
import pytest

from drive_traces import Errors, Segment, drive
from raccoon.core.config import RobotConfig
from raccoon.estimate.drive.odometry import Odometry


def test_what_is_seen_late_does_not_forget_that_a_wheel_slipped() -> None:
    """It stood within the steps that are taken again, but it does not stand now."""
    odometry = Odometry(RobotConfig())
    for inputs, command in drive([(1.0, 0.0, 0.0), (1.1, 0.2, 0.0)], Errors(slip=(1.6, 2.5, "left", 0.5))):
        odometry.update(inputs, command)
    assert odometry.slipped
    assert odometry.observe_heading(0.0, std=1.0, time=0.9).accepted
    assert odometry.slipped


def test_what_is_seen_late_makes_no_scales_that_none_has() -> None:
    """Both were learnt again within these seconds. A wheel that reads 2.2 times its way has no such scale."""
    odometry = Odometry(RobotConfig())
    for inputs, command in drive([(0.6, 0.0, 0.0), (3.9, 0.2, 0.0)], Errors(scale=(1.0, 2.2))):
        odometry.update(inputs, command)
    before = odometry.wheel_scales
    assert odometry.observe_heading(odometry.estimate.heading, std=1.0, time=inputs.time - 1.8).accepted
    assert odometry.wheel_scales == pytest.approx(before, abs=0.01)


def test_what_is_seen_late_does_not_forget_that_a_scale_may_be_wrong() -> None:
    """The doubt about the way came within the steps that are taken again."""
    odometry = Odometry(RobotConfig())
    for inputs, command in drive([(0.6, 0.0, 0.0), (1.6, 0.2, 0.0)], Errors(scale=(1.0, 1.3))):
        odometry.update(inputs, command)
    before = odometry.estimate.x_std
    assert before > 0.01
    assert odometry.observe_heading(odometry.estimate.heading, std=1.0, time=0.7).accepted
    assert odometry.estimate.x_std == pytest.approx(before, rel=0.05)


@pytest.mark.parametrize("cycle", [0.002, 0.005, 0.0176, 0.02])
def test_what_was_seen_in_the_last_two_seconds_counts_at_every_rate(cycle: float) -> None:
    odometry = Odometry(RobotConfig())
    for inputs, command in drive([(2.5, 0.0, 0.0)], dt=cycle):
        odometry.update(inputs, command)
    assert odometry.observe_heading(0.0, std=0.1, time=inputs.time - 1.95).accepted


def test_between_two_readings_of_the_gyro_the_wheels_turn_by_the_track_that_was_learnt() -> None:
    odometry = Odometry(RobotConfig())
    rates: dict[bool, list[float]] = {True: [], False: []}
    turns: list[Segment] = [(0.6, 0.0, 0.0), (1.0, 0.0, 1.6), (0.3, 0.0, 0.0), (1.5, 0.0, 1.6)]
    for inputs, command in drive(turns, Errors(track=1.08), gyro_every=4):
        estimate = odometry.update(inputs, command)
        if inputs.time > 2.4:
            rates[inputs.gyro is not None].append(estimate.turn_rate)
    assert np.mean(rates[False]) == pytest.approx(np.mean(rates[True]), rel=0.004)
