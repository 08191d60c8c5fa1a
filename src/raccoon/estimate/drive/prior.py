"""What is believed about a robot before it moves: state, covariance and noise from its `robot.toml`."""

from __future__ import annotations

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device
from raccoon.estimate.drive.wheels import counts_scale
from raccoon.estimate.ekf.filter import ProcessNoise
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import SIZE, OdometrySettings, State


def prior(robot: RobotConfig, settings: OdometrySettings, device: Device) -> tuple[Array, Array]:
    """Mean (12,) and covariance (12, 12) of a robot that stands at the origin."""
    mean = np.zeros(SIZE)
    deviations = np.zeros(SIZE)
    imu, drive = robot.model.imu, robot.model.drive
    mean[State.GYRO_BIAS] = imu.gyro_bias.value
    mean[State.GYRO_SCALE] = imu.gyro_scale.value
    mean[[State.LEFT_SCALE, State.RIGHT_SCALE, State.TRACK_SCALE]] = 1.0
    deviations[[State.X, State.Y, State.HEADING]] = 1e-4
    deviations[State.VELOCITY], deviations[State.TURN_RATE] = 0.1, 0.5
    deviations[State.GYRO_BIAS] = max(imu.gyro_bias.std, settings.gyro_bias)
    deviations[State.GYRO_SCALE] = max(imu.gyro_scale.std, 1e-5)
    deviations[State.TRACK_SCALE] = max(drive.track_width.std / drive.track_width.value, 1e-4)
    for side, offset, scale in (
        ("left", State.LEFT_OFFSET, State.LEFT_SCALE),
        ("right", State.RIGHT_OFFSET, State.RIGHT_SCALE),
    ):
        deviations[offset] = offset_std_counts(robot, settings, side) * counts_scale(robot, side, device)
        deviations[scale] = scale_std(robot, settings, side)
    return mean, np.diag(deviations**2)


def offset_std_counts(robot: RobotConfig, settings: OdometrySettings, side: str) -> float:
    """Standard deviation of a motor's back-EMF offset, counts; 0 says it has none (an encoder)."""
    own = robot.motor(getattr(robot.drive, side)).bemf_offset
    if own is not None:
        return own.std
    return max(robot.model.bemf.offset.std, settings.uncalibrated_offset_counts)


def scale_std(robot: RobotConfig, settings: OdometrySettings, side: str) -> float:
    """Relative standard deviation of the metres of one count · second."""
    own = robot.motor(getattr(robot.drive, side)).radians_per_tick
    if own is not None:
        return max(own.std / own.value, settings.calibrated_scale)
    radius, constant = robot.model.drive.wheel_radius, getattr(robot.model, side).back_emf_constant
    known = float(np.hypot(radius.std / radius.value, constant.std / constant.value))
    return float(max(known, settings.uncalibrated_scale))


def process_noise(robot: RobotConfig, settings: OdometrySettings, radians_per_count: float) -> ProcessNoise:
    """How fast the state wanders. radians_per_count: wheel speed of one back-EMF count, rad/s.

    An offset that is exactly known (an encoder's) does not wander.
    """
    offset_std = max(offset_std_counts(robot, settings, side) for side in ("left", "right"))
    walk = settings.offset_walk_counts if offset_std > 0.0 else 0.0
    return ProcessNoise(
        velocity=settings.acceleration**2,
        turn_rate=settings.turn_acceleration**2,
        gyro_bias=settings.gyro_bias_walk**2,
        offset=(walk * radians_per_count) ** 2,
        scale=settings.scale_walk**2,
    )
