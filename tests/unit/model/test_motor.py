"""The equations of a motor."""

import math

import pytest

from raccoon.model.motor import speed_after, steady_speed

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


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize(("speed", "torque"), [(3.0, -0.9), (3.0, 0.9), (0.0, 0.5), (-2.0, 0.1), (0.0, 0.1)])
def test_the_speed_of_a_shaft_solves_its_equation(speed: float, torque: float, damping: float) -> None:
    coulomb, inertia, steps = 0.2, 0.02, 2000
    expected = speed
    for _ in range(steps):
        rubs = math.copysign(coulomb, expected or torque)
        new = expected + (torque - rubs - damping * expected) / inertia * 0.1 / steps
        held = expected == 0.0 and abs(torque) <= coulomb
        expected = 0.0 if held or new * expected < 0.0 else new
    after = speed_after(0.1, speed, torque, coulomb, damping, inertia)
    assert after == pytest.approx(expected, abs=5e-3)
    assert speed_after(0.1, -speed, -torque, coulomb, damping, inertia) == -after
    halfway = speed_after(0.05, speed, torque, coulomb, damping, inertia)
    assert speed_after(0.05, halfway, torque, coulomb, damping, inertia) == pytest.approx(after)
