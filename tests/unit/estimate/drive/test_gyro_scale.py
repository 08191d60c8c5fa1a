"""A gyro's scale that nobody measured: how sure the heading is, and what walls teach."""

import math
from dataclasses import replace

import pytest

from drive_traces import Errors, Segment, drive
from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.core.readings import SIMULATOR, Truth
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.ekf.state import State

REST: Segment = (1.0, 0.0, 0.0)
QUARTER: list[Segment] = [(1.0, 0.0, 1.6), (0.8, 0.0, 0.0)]
WALL_STD = math.radians(1.0)


def taped() -> RobotConfig:
    """Wheels that were calibrated along a tape, on a track by a ruler."""
    tick = SIMULATOR.bemf_volts / RobotConfig().model.left.back_emf_constant.value
    motor = MotorConfig(radians_per_tick=Measured(tick, 0.003 * tick), bemf_offset=Measured(0.0, 1.0))
    return replace(RobotConfig(), motors={0: motor, 1: motor})


def after(turns: int, errors: Errors, *, walls: bool = False) -> tuple[Odometry, Truth, int]:
    """Quarter turns; the odometry, the truth, and how many of the walls after each were not believed."""
    odometry, refused, due = Odometry(taped()), 0, 1.0 + 1.8
    truth = Truth(0.0, 0.0, 0.0)
    for inputs, command in drive([REST, *QUARTER * turns, REST], errors, seed=3):
        odometry.update(inputs, command)
        assert inputs.truth is not None
        truth = inputs.truth
        if walls and inputs.time >= due:
            due += 1.8
            refused += not odometry.observe_heading(truth.heading, WALL_STD).accepted
    return odometry, truth, refused


@pytest.mark.parametrize("scale", [0.99, 1.0, 1.01])
def test_a_gyro_that_is_a_percent_off_is_within_what_the_heading_claims(scale: float) -> None:
    odometry, truth, _ = after(3, Errors(gyro_scale=scale))
    off = abs(odometry.estimate.heading - truth.heading)
    assert off < 2.5 * odometry.estimate.heading_std < math.radians(4.0)


def test_walls_teach_the_scale_and_are_believed() -> None:
    """At 0.1 % six of the eight were refused, and the heading was further off with each turn."""
    odometry, truth, refused = after(8, Errors(gyro_scale=1.015), walls=True)
    assert not refused
    assert abs(odometry.estimate.heading - truth.heading) < math.radians(1.5)
    assert odometry._stepper.fusion.drive.flat[State.GYRO_SCALE] == pytest.approx(1.015, abs=0.006)


@pytest.mark.parametrize("track", [0.95, 1.05])
def test_wheels_teach_the_gyro_nothing(track: float) -> None:
    """What they turn otherwise is the track's and their own, and turns no robot that the gyro has right."""
    odometry, truth, _ = after(4, Errors(track=track))
    assert odometry._stepper.fusion.drive.flat[State.GYRO_SCALE] == pytest.approx(1.0, abs=0.001)
    assert abs(odometry.estimate.heading - truth.heading) < math.radians(0.5)
