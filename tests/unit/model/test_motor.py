"""The equations of a motor."""

import math

import pytest

from raccoon.model.motor import current, steady_speed, time_constant

MOTOR = (1.8, 1.08)


def test_at_a_steady_speed_torque_and_friction_balance() -> None:
    for speed in (-5.0, -0.3, 0.4, 6.0):
        friction = math.copysign(0.18, speed) + 0.004 * speed
        voltage = 1.08 * speed + 1.8 * friction / 1.08
        assert steady_speed(voltage, *MOTOR, coulomb=0.18, viscous=0.004) == pytest.approx(speed)


def test_too_little_voltage_does_not_break_loose() -> None:
    stuck = 0.18 * 1.8 / 1.08
    assert steady_speed(stuck, *MOTOR, coulomb=0.18) == 0.0
    assert steady_speed(-stuck, *MOTOR, coulomb=0.18) == 0.0
    assert steady_speed(1.01 * stuck, *MOTOR, coulomb=0.18) > 0.0


def test_current_at_standstill_and_at_the_free_running_speed() -> None:
    assert current(6.8, 0.0, *MOTOR) == pytest.approx(6.8 / 1.8)
    assert current(6.8, steady_speed(6.8, *MOTOR), *MOTOR) == pytest.approx(0.0)


def test_friction_shortens_the_time_constant() -> None:
    assert time_constant(0.02, *MOTOR) == pytest.approx(0.02 * 1.8 / 1.08**2)
    assert time_constant(0.02, *MOTOR, viscous=0.1) < time_constant(0.02, *MOTOR)
