"""A motor that drives no wheel, against the motor equation in closed form."""

import math

import pytest

from raccoon.core.config import MotorConfig, RobotConfig
from raccoon.core.readings import SIMULATOR
from raccoon.sim.plant.free_motor import FreeMotor

DT, BATTERY, INERTIA = 0.005, 7.0, 0.003
CONFIG = RobotConfig()
R, K = CONFIG.model.left.armature_resistance.value, CONFIG.model.left.back_emf_constant.value
COULOMB, VISCOUS = CONFIG.model.friction.coulomb.value, CONFIG.model.friction.viscous.value


def turned(motor: FreeMotor, duty: float | None, seconds: float) -> FreeMotor:
    for _ in range(round(seconds / DT)):
        motor.step(duty, BATTERY, DT)
    return motor


def test_it_comes_to_the_speed_at_which_torque_and_friction_balance() -> None:
    motor = turned(FreeMotor(CONFIG, 2, INERTIA), 0.5, 1.0)
    pull = K * (0.5 * BATTERY - K * motor.speed) / R
    assert pull == pytest.approx(COULOMB + VISCOUS * motor.speed)
    assert motor.back_emf == pytest.approx(K * motor.speed)
    assert motor.words[0] == pytest.approx(K * motor.speed / SIMULATOR.bemf_volts, abs=1.0)


def test_with_open_terminals_friction_alone_stops_it() -> None:
    motor = turned(FreeMotor(CONFIG, 2, INERTIA), -0.5, 1.0)
    start = motor.speed
    turned(motor, None, 2.0 * DT)
    left = COULOMB / VISCOUS - (COULOMB / VISCOUS - start) * math.exp(-2.0 * DT * VISCOUS / INERTIA)
    assert motor.speed == pytest.approx(left)
    assert turned(motor, None, -start * INERTIA / COULOMB).speed == 0.0


def test_dry_friction_slows_a_motor_that_brakes_or_turns_round() -> None:
    motor = turned(FreeMotor(CONFIG, 2, INERTIA), 0.5, 1.0)
    start, damping = motor.speed, VISCOUS + K * K / R
    until_rest = INERTIA / damping * math.log1p(start * damping / COULOMB)
    assert turned(motor, 0.0, until_rest + DT).speed == 0.0  # and not for ever slower
    motor = turned(FreeMotor(CONFIG, 2, INERTIA), 0.5, 1.0)
    motor.step(-0.5, BATTERY, 1e-6)
    slowing = 0.5 * BATTERY * K / R + COULOMB + damping * start
    assert motor.speed - start == pytest.approx(-slowing / INERTIA * 1e-6, rel=1e-3)


def test_a_stop_ends_its_way_and_its_speed() -> None:
    motor = FreeMotor(CONFIG, 2, INERTIA)
    motor.stops = (-math.inf, 0.4)
    turned(motor, 0.5, 1.0)
    assert (motor.angle, motor.speed) == (0.4, 0.0)
    assert turned(motor, -0.5, 0.1).angle < 0.4


def test_its_words_carry_the_wiring_sign() -> None:
    inverted = RobotConfig(motors={2: MotorConfig(inverted=True)})
    plain, turned_round = (
        turned(FreeMotor(config, 2, INERTIA), duty, 0.5) for config, duty in ((CONFIG, 0.5), (inverted, -0.5))
    )
    assert turned_round.speed == plain.speed
    assert turned_round.words == tuple(-each for each in plain.words)
    assert turned_round.back_emf == -plain.back_emf
