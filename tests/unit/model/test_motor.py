"""Motor and battery equations and their inverses."""

import pytest

from raccoon.model.motor import current, stall_torque, steady_speed, time_constant, torque, voltage_for_speed

MOTOR = (1.8, 1.08)


def test_speed_and_voltage_are_inverse() -> None:
    for speed in (-5.0, -0.3, 0.4, 6.0):
        voltage = voltage_for_speed(speed, *MOTOR, coulomb=0.18, viscous=0.004)
        assert steady_speed(voltage, *MOTOR, coulomb=0.18, viscous=0.004) == pytest.approx(speed)
    assert voltage_for_speed(0.0, *MOTOR, coulomb=0.18) == 0.0


def test_too_little_voltage_does_not_break_loose() -> None:
    stuck = 0.18 * 1.8 / 1.08
    assert steady_speed(stuck, *MOTOR, coulomb=0.18) == 0.0
    assert steady_speed(-stuck, *MOTOR, coulomb=0.18) == 0.0
    assert steady_speed(1.01 * stuck, *MOTOR, coulomb=0.18) > 0.0


def test_torque_at_standstill_and_at_the_free_running_speed() -> None:
    assert torque(current(6.8, 0.0, *MOTOR), 1.08) == pytest.approx(stall_torque(6.8, *MOTOR))
    assert current(6.8, steady_speed(6.8, *MOTOR), *MOTOR) == pytest.approx(0.0)


def test_friction_shortens_the_time_constant() -> None:
    assert time_constant(0.02, *MOTOR) == pytest.approx(0.02 * 1.8 / 1.08**2)
    assert time_constant(0.02, *MOTOR, viscous=0.1) < time_constant(0.02, *MOTOR)
