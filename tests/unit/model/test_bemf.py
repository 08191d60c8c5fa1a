import math

import pytest

from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.core.readings import SIMULATOR
from raccoon.model.bemf import counter_lag, counts_scale


@pytest.mark.parametrize("time_constant", [0.01, 0.0225, 0.05])
def test_the_counter_of_a_wheel_that_speeds_up_is_behind_by_the_lag(time_constant: float) -> None:
    T, acceleration = 0.005, 3.0
    filtered = counter = 0.0
    for cycle in range(1, 2001):
        speed = acceleration * cycle * T
        filtered += (1.0 - math.exp(-T / time_constant)) * (speed - filtered)
        counter += filtered * T
    angle = 0.5 * acceleration * (2000 * T) ** 2
    late = 0.5 * acceleration * (time_constant * T)  # what the change of the last samples still hides
    assert angle == pytest.approx(counter + counter_lag(time_constant, T) * filtered, abs=late)


def test_a_filter_faster_than_its_samples_is_not_behind() -> None:
    assert counter_lag(0.0, 0.005) == 0.0
    assert counter_lag(1e-4, 0.005) == 0.0
    assert counter_lag(1e-6, 0.005) == 0.0  # whose exponential is beyond every float
    assert counter_lag(0.95 * 0.005, 0.005) > 0.0


def test_a_count_is_worth_what_the_calibration_says_and_else_what_the_nominal_motor_says() -> None:
    robot = RobotConfig(motors={1: MotorConfig(inverted=True, radians_per_tick=Measured(0.004, 0.0001))})
    constant = robot.model.left.back_emf_constant.value
    assert counts_scale(robot, "left", SIMULATOR) == SIMULATOR.bemf_volts / constant
    assert counts_scale(robot, "right", SIMULATOR) == 0.004 / SIMULATOR.position_counts_seconds
