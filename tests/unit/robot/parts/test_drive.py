"""What the drive base makes of a wish, held to the motor equation."""

from dataclasses import replace

import pytest

from raccoon import RobotConfig
from raccoon.core.config import Measured, MotorConfig
from raccoon.estimate.drive.odometry import Odometry
from raccoon.robot.parts.drive import Drive


@pytest.mark.parametrize("inverted", [False, True])
def test_a_velocity_is_what_each_motor_takes_for_its_wheels_speed_and_its_change(inverted: bool) -> None:
    """U = (R / K_E) (T_c + b w + J dw/dt) + K_E w, of the wheels of a robot that stood. J dw/dt adds that of
    the way straight on and that of the turn, each with its own inertia."""
    base = RobotConfig()
    motor = MotorConfig(inverted=inverted, power_factor=Measured(0.9))
    config = replace(base, motors={0: motor, 1: motor})
    drive, model = Drive(config), config.model
    drive.velocity(0.12, 0.4, 0.3, 1.5)
    duty = drive.outputs(Odometry(config).estimate, 0.005, 6.6).duty
    radius, half = model.drive.wheel_radius.value, 0.5 * model.drive.track_width.value
    straight, turning = model.drive.inertia_straight.value, model.drive.inertia_turn.value
    for port, side, sent in ((0, -1.0, duty[0]), (1, 1.0, duty[1])):
        wheel = (model.left, model.right)[port]
        speed = (0.12 + side * 0.4 * half) / radius
        inertial = (straight * 0.3 + side * turning * 1.5 * half) / radius
        torque = model.friction.coulomb.value + model.friction.viscous.value * speed + inertial
        constant = wheel.back_emf_constant.value
        volts = wheel.armature_resistance.value / constant * torque + constant * speed
        assert sent == pytest.approx((-0.9 if inverted else 0.9) * volts / 6.6)
    assert duty[2:] == (0.0, 0.0)


def test_nothing_runs_on_by_being_forgotten() -> None:
    drive, estimate = Drive(RobotConfig()), Odometry(RobotConfig()).estimate
    for controlled in (True, False):
        if controlled:
            drive.velocity(0.1)
        else:
            drive.duties(0.3, 0.3)
        assert any(drive.outputs(estimate, 0.005, 6.6).duty)
        assert not any(drive.outputs(estimate, 0.005, 6.6).duty)
