"""The feedforward is the motor equation turned round."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.control.feedforward import WheelModel, wheel_models
from raccoon.core.config import Measured, MotorConfig, RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.readings import SIMULATOR
from raccoon.model.paper import MOTORS, PaperMotor

WHEEL = WheelModel(resistance=1.8, back_emf_constant=1.08, coulomb=0.18, viscous=0.004, inertia=0.02)


@pytest.mark.parametrize("motor", MOTORS)
def test_gives_the_papers_voltage_at_the_papers_speed(motor: PaperMotor) -> None:
    wheel = WheelModel(motor.armature_resistance, motor.back_emf_constant, motor.friction_torque, 0.0, 0.02)
    assert wheel.voltage(motor.speed) == pytest.approx(6.6, abs=2e-3)
    assert wheel.top_speed(6.6) == pytest.approx(motor.speed, abs=2e-3)


@given(st.floats(0.01, 10.0))
def test_top_speed_inverts_the_voltage(speed: float) -> None:
    assert WHEEL.top_speed(WHEEL.voltage(speed)) == pytest.approx(speed)


@given(st.floats(-10.0, 10.0), st.floats(-50.0, 50.0))
def test_is_odd(speed: float, acceleration: float) -> None:
    assert WHEEL.voltage(-speed, -acceleration) == pytest.approx(-WHEEL.voltage(speed, acceleration))


def test_rest_needs_nothing_and_starting_needs_friction() -> None:
    assert WHEEL.voltage(0.0) == 0.0
    assert WHEEL.voltage(0.0, 1e-9) == pytest.approx(1.8 / 1.08 * 0.18, rel=1e-6)
    assert WHEEL.top_speed(0.1) == 0.0


def test_voltage_makes_the_acceleration_it_was_asked_for() -> None:
    voltage = WHEEL.voltage(3.0, 5.0)
    current = (voltage - WHEEL.back_emf_constant * 3.0) / WHEEL.resistance
    torque = WHEEL.back_emf_constant * current - WHEEL.viscous * 3.0 - WHEEL.coulomb
    assert torque / WHEEL.inertia == pytest.approx(5.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_wheel_that_presses_gets_the_volts_of_its_torque_and_never_more_than_those_of_its_speed(
    sign: float,
) -> None:
    wheel = WheelModel(1.8, 1.08, 0.18, 0.004, 0.02)
    standing = 1.8 / 1.08 * (0.18 + 0.276)  # friction and torque, through the resistance
    assert wheel.pressing_voltage(2.0 * sign, 0.0, 0.276) == pytest.approx(sign * standing)
    assert wheel.pressing_voltage(2.0 * sign, -0.3 * sign, 0.276) == pytest.approx(sign * standing)
    turning = standing + 1.08 * 0.5 + 1.8 / 1.08 * 0.004 * 0.5
    assert wheel.pressing_voltage(2.0 * sign, 0.5 * sign, 0.276) == pytest.approx(sign * turning)
    assert wheel.pressing_voltage(2.0 * sign, 2.0 * sign, 0.276) == wheel.voltage(2.0 * sign)
    assert wheel.pressing_voltage(2.0 * sign, 0.0, float("inf")) == wheel.voltage(2.0 * sign)


def test_time_constant_is_that_of_a_simulated_step() -> None:
    frictionless = WheelModel(1.8, 1.08, 0.0, 0.004, 0.02)
    speed, time = 0.0, 0.0
    goal = frictionless.gain * 3.0
    while speed < 0.632120558 * goal:
        current = (3.0 - 1.08 * speed) / 1.8
        speed += 1e-6 * (1.08 * current - 0.004 * speed) / 0.02
        time += 1e-6
    assert time == pytest.approx(frictionless.time_constant, rel=1e-3)


def test_measured_voltages_are_those_that_the_wheel_then_takes() -> None:
    wheel = WHEEL.with_voltages(static=0.4, speed=1.2, acceleration=0.05)
    assert wheel.static_voltage == pytest.approx(0.4)
    assert 1.0 / wheel.gain == pytest.approx(1.2)
    assert wheel.acceleration_voltage == pytest.approx(0.05)
    assert wheel.back_emf_constant == 1.08


def test_a_speed_that_takes_less_than_its_back_emf_has_no_friction_that_pushes() -> None:
    wheel = WHEEL.with_voltages(static=0.3, speed=0.9)
    assert (wheel.back_emf_constant, wheel.viscous) == (0.9, 0.0)
    assert wheel.voltage(2.0) == pytest.approx(0.3 + 0.9 * 2.0)


def test_models_come_from_the_configuration() -> None:
    left, right = wheel_models(RobotConfig())
    assert left == right
    assert left.back_emf_constant == 1.08
    assert left.inertia == 0.020


@pytest.mark.parametrize(("share", "believed"), [(0.3, False), (0.8, True), (1.25, True), (3.0, False)])
def test_a_calibrated_counter_tells_the_motor_s_back_emf_constant(share: float, believed: bool) -> None:
    """Of a motor of that K_E a radian counts so much more; what no motor has is left to [model]."""
    a_tick = SIMULATOR.bemf_volts * SIMULATOR.position_counts_seconds / (share * 1.08)
    config = RobotConfig(motors={1: MotorConfig(radians_per_tick=Measured(a_tick, 0.01 * a_tick))})
    left, right = wheel_models(config, SIMULATOR)
    assert left.back_emf_constant == 1.08
    assert right.back_emf_constant == pytest.approx(share * 1.08 if believed else 1.08)
    assert wheel_models(config)[1].back_emf_constant == 1.08  # whose ticks they are is not known yet


@pytest.mark.parametrize("factor", [1.0 / 181.0, 181.0])
def test_ticks_of_another_firmware_are_refused(factor: float) -> None:
    a_tick = factor * SIMULATOR.bemf_volts * SIMULATOR.position_counts_seconds / 1.08
    config = RobotConfig(motors={1: MotorConfig(radians_per_tick=Measured(a_tick, 0.01 * a_tick))})
    with pytest.raises(ConfigError, match=r"motor\.1\.radians_per_tick is .* another firmware"):
        wheel_models(config, SIMULATOR)
