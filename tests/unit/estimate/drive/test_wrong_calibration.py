"""A robot.toml that is far more wrong about the wheels than it says: what it makes of the way is in doubt."""

import math
from dataclasses import replace
from datetime import date

import pytest

from drive_traces import Errors, Segment, drive
from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.core.readings import SIMULATOR
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.drive.scale_doubt import NO_DOUBT, ScaleDoubt
from raccoon.estimate.ekf.filter import covariance_index, variance_index
from raccoon.estimate.ekf.state import State

REST: Segment = (1.0, 0.0, 0.0)
STRAIGHT: Segment = (2.0, 0.18, 0.0)
TURN: Segment = (1.0, 0.0, 1.6)
UNLIKE = [(1.1, 1.0), (1.0, 1.1), (1.0, 0.93), (1.04, 1.0)]


def calibrated(measured: bool = False) -> RobotConfig:
    """Wheels that are known to 0.3 %, and if it was measured, the track to 0.1 %."""
    config = RobotConfig()
    if measured:
        track = Measured(0.16, 0.00016, date=date(2026, 1, 1))
        drive_model = replace(config.model.drive, track_width=track)
        config = replace(config, model=replace(config.model, drive=drive_model))
    tick = SIMULATOR.bemf_volts / config.model.left.back_emf_constant.value
    motor = MotorConfig(
        radians_per_tick=Measured(tick, 0.003 * tick), bemf_offset=Measured(0.0, 1.0), inverted=False
    )
    return replace(config, motors={0: motor, 1: motor})


def driven(
    segments: list[Segment],
    scale: tuple[float, float],
    *,
    track: float = 1.0,
    config: RobotConfig | None = None,
    seed: int = 3,
) -> tuple[Odometry, float, float]:
    """The odometry, and the error and the deviation of the place that it states, m."""
    odometry = Odometry(config or calibrated())
    for inputs, command in drive([REST, *segments, REST], Errors(scale=scale, track=track), seed=seed):
        estimate = odometry.update(inputs, command)
    truth = inputs.truth
    assert truth is not None
    error = math.hypot(estimate.x - truth.x, estimate.y - truth.y)
    return odometry, error, math.hypot(estimate.x_std, estimate.y_std)


@pytest.mark.parametrize("scale", UNLIKE)
def test_a_wheel_that_was_calibrated_wrong_is_a_doubt_of_the_way(scale: tuple[float, float]) -> None:
    _, error, deviation = driven([STRAIGHT], scale)
    assert error < 2.0 * deviation
    assert deviation < 3.0 * error


@pytest.mark.parametrize("measured", [False, True])
def test_a_turn_tells_which_of_both_wheels_it_is(measured: bool) -> None:
    odometry, error, deviation = driven([STRAIGHT, REST, TURN], (1.1, 1.0), config=calibrated(measured))
    left, right = odometry.wheel_scales
    assert left == pytest.approx(1.1, abs=0.03)
    assert right == pytest.approx(1.0, abs=0.03)
    assert error < min(0.01, 2.0 * deviation)
    assert deviation < 0.02


def test_wheels_within_what_robot_toml_says_are_doubted_no_further() -> None:
    _, error, deviation = driven([STRAIGHT, REST, TURN], (1.004, 0.998))
    assert max(error, deviation) < 0.004


@pytest.mark.parametrize(("scale", "track"), [((1.04, 1.04), 1.0), ((1.0, 1.0), 1.05), ((1.0, 1.0), 0.95)])
def test_where_turns_are_otherwise_it_may_be_both_wheels_or_the_track(
    scale: tuple[float, float], track: float
) -> None:
    """The filter shares it among them as robot.toml is sure of them; either may be all of it."""
    _, error, deviation = driven(
        [STRAIGHT, REST, TURN, REST, STRAIGHT], scale, track=track, config=calibrated(measured=True)
    )
    assert error < 2.0 * deviation


def test_a_doubt_is_counted_once_and_what_one_wheel_explains_is_none_of_the_track() -> None:
    flat = list(Odometry(calibrated())._stepper.fusion.drive.flat)
    doubt = ScaleDoubt(tuple(flat))
    assert doubt.added_deviations(tuple(flat)) == NO_DOUBT
    flat[State.WHEEL_TURN] = 0.9
    assert doubt.added_deviations(tuple(flat)) == pytest.approx((0.0, 0.1))
    assert doubt.added_deviations(tuple(flat)) == NO_DOUBT
    flat[State.BALANCE] = -0.1
    assert doubt.added_deviations(tuple(flat)) == pytest.approx((0.1, 0.0))
    flat[State.BALANCE] = -0.2
    assert doubt.added_deviations(tuple(flat)) == pytest.approx((math.sqrt(0.2**2 - 0.1**2), 0.0))


def test_a_doubt_of_the_way_is_one_of_all_that_hangs_together_with_it() -> None:
    odometry, _, _ = driven([STRAIGHT], (1.0, 1.0))
    drive_filter = odometry._stepper.fusion.drive
    way, place = variance_index(State.WAY), covariance_index(State.X, State.WAY)
    before = drive_filter.flat
    drive_filter.widen_way(0.03, 0.04)
    after = drive_filter.flat
    assert after[way] == pytest.approx(before[way] + 0.05**2)
    # Metres that the place is off for a way that is off: the same as before, about those that it went.
    assert after[place] / after[way] == pytest.approx(before[place] / before[way])
    assert math.sqrt(after[variance_index(State.X)]) == pytest.approx(0.05 * 0.36, rel=0.15)
