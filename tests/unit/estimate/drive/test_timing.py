"""Delay between wheels and gyro, and scales that a straight drive does not show."""

import math

import pytest

from drive_traces import Errors, Segment, drive
from raccoon import open_robot, seq, straight, turn, wait
from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Inputs
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.drive.readings import KINK_SHARE, DriveReadings
from raccoon.estimate.drive.timing import (
    MIN_SHAKING,
    SHAKING_MEMORY_S,
    Shaking,
    TurnAcceleration,
    wheels_lead,
)
from raccoon.estimate.ekf.filter import variance_index
from raccoon.estimate.ekf.state import SIZE, State
from raccoon.robot.emulated import open_emulated
from raccoon.sim.world.table import World

REST, TURN, STRAIGHT = (1.0, 0.0, 0.0), (1.0, 0.0, 1.6), (4.0, 0.18, 0.0)


def driven(segments: list[Segment], errors: Errors) -> Odometry:
    odometry = Odometry(RobotConfig())
    for inputs, command in drive(segments, errors, seed=5):
        odometry.update(inputs, command)
    return odometry


@pytest.mark.parametrize("latency", [0.0, 0.01, 0.02])
def test_a_late_gyro_is_found_out_in_turns(latency: float) -> None:
    odometry = driven([REST, TURN, REST, TURN, REST], Errors(imu_latency=latency))
    flat = odometry._stepper.fusion.drive.flat
    delay, std = flat[State.GYRO_DELAY], math.sqrt(flat[variance_index(State.GYRO_DELAY)])
    assert delay == pytest.approx(latency, abs=0.003)
    assert std < 0.003


def test_driving_straight_does_not_move_what_it_does_not_show() -> None:
    odometry = driven([REST, *([STRAIGHT] * 4)], Errors(scale=(1.02, 0.98)))
    flat = odometry._stepper.fusion.drive.flat
    assert flat[State.BALANCE] == pytest.approx(-0.02, abs=0.002)
    assert flat[State.WAY] == pytest.approx(1.0, abs=0.01)
    assert math.sqrt(flat[variance_index(State.WAY)]) > 0.03


def test_slip_is_no_delay() -> None:
    swing = TurnAcceleration()
    assert swing.update(0.02, 0.5, 0.0) == 0.0  # the wheels turn, the robot does not
    swing = TurnAcceleration()
    assert swing.update(0.02, 0.5, 0.4) == pytest.approx(25.0)
    assert swing.update(0.02, 0.505, 0.5) == 0.0  # noise


def test_wheels_behind_the_gyro_are_late_themselves_and_else_half_is_theirs() -> None:
    flat = [0.0] * (SIZE + SIZE * (SIZE + 1) // 2)
    flat[State.GYRO_DELAY] = -0.01
    assert wheels_lead(tuple(flat), 0.0) == (-0.01, 0.0)
    flat[State.GYRO_DELAY] = 0.02
    assert wheels_lead(tuple(flat), 0.0) == pytest.approx((0.01, 0.01))


def test_a_turn_that_begins_shakes_nobody_and_one_that_goes_to_and_fro_does() -> None:
    shaking = Shaking()
    assert shaking.update(0.02, -3.0, 3.0) == 0.0
    assert all(shaking.update(0.02, -3.0, 3.0) == 0.0 for _ in range(20))
    kept, keep = 3.0 * math.exp(-0.02 * 21 / SHAKING_MEMORY_S), math.exp(-0.02 / SHAKING_MEMORY_S)
    assert shaking.update(0.02, 0.0, 0.0) == 0.0  # it ends long after
    assert shaking.update(0.02, -3.0, 3.0) == 0.0  # another one
    again = shaking.update(0.02, 0.0, 0.0)
    up, down = (kept * keep + 3.0) * keep, 3.0 * keep**2 + 3.0
    assert again == pytest.approx(min(up, down) - MIN_SHAKING)


def test_a_turn_that_ends_as_soon_as_it_has_begun_shakes_nobody() -> None:
    """Of 7 degrees, at the motions' 6 rad/s2: only its beginning told the filter anything."""
    shaking = Shaking()
    halves = [0.25 * min(step, 16 - step) for step in range(17)]
    assert all(shaking.update(0.02, -half, half) == 0.0 for half in halves)


def test_a_coarse_gyro_sees_no_peak_between_two_readings_and_all_of_an_even_rise() -> None:
    readings, doubts = DriveReadings(RobotConfig()), []
    for step, rate in enumerate((0.0, 0.0, 0.1, 0.2, 0.3, 0.25)):
        counts = rate / SIMULATOR.gyro_rad_s
        position, gyro = (0.0, 0.0, None, None), (0.0, 0.0, counts)
        readings.take(Inputs(0.02 * step, SIMULATOR, position=position, gyro=gyro))
        doubts.append(readings.pending.gyro_kink_variance)
        readings.clear()
    assert doubts[3:5] == pytest.approx([0.0, 0.0])
    assert doubts[5] == pytest.approx((KINK_SHARE * 0.15) ** 2)


def test_small_turns_of_an_uncalibrated_robot_are_no_wrong_scale() -> None:
    """Behind RaccoonOS, whose gyro is read once in 20 ms and sees no turn's peak. They moved its place by
    30 mm after a metre."""
    with open_robot(RobotConfig(), port=open_emulated(RobotConfig(), 21, world=World.empty())) as robot:
        robot.run(seq(wait(0.5), straight(0.1), turn(math.radians(7.0))))
        assert robot.odometry.wheel_scales == pytest.approx((1.0, 1.0), abs=0.006)


@pytest.mark.parametrize(("delay", "lead", "late"), [(0.02, 0.01, 0.01**2 + 0.25), (-0.02, -0.02, 1.0)])
def test_how_unsure_the_lead_of_the_wheels_is(delay: float, lead: float, late: float) -> None:
    """Half of a delay may be all or nothing of it, and half of its deviation is in half of it."""
    flat = [0.0] * (SIZE + SIZE * (SIZE + 1) // 2)
    flat[State.GYRO_DELAY], flat[variance_index(State.GYRO_DELAY)] = delay, 1.0
    assert wheels_lead(tuple(flat), 0.005) == pytest.approx((lead, math.sqrt(0.005**2 + late)))
