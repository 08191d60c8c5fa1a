"""What the motors draw from the battery by their models."""

from dataclasses import replace

import pytest

from raccoon import RobotConfig
from raccoon.core.config import Measured, MotorConfig
from raccoon.estimate.drive.odometry import Odometry
from raccoon.robot.parts.drive import Drive


@pytest.mark.parametrize("factor", [1.0, 0.5])
@pytest.mark.parametrize("inverted", [False, True])
def test_motors_that_stand_draw_what_their_duty_says(factor: float, inverted: bool) -> None:
    """P = U^2 / R at the motor, of which the battery has all."""
    motor = MotorConfig(inverted=inverted, power_factor=Measured(factor))
    config = replace(RobotConfig(), motors={0: motor, 1: motor})
    drive = Drive(config)
    drive.duties(0.8, -0.4)
    sent = drive.outputs(Odometry(config).estimate, 0.005, 6.6).duty
    sign = -factor if inverted else factor
    assert sent == pytest.approx((0.8 * sign, -0.4 * sign, 0.0, 0.0))
    power = sum(
        (duty * 6.6) ** 2 / wheel.resistance for duty, wheel in zip(sent, drive.wheels.models, strict=False)
    )
    assert drive.current(0.0, 0.0, 6.6) == pytest.approx(power / 6.6)
