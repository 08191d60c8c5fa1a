"""Prior of the drive filter before the robot moves: state, covariance and process noise from its
`robot.toml`."""

from __future__ import annotations

import numpy as np

from raccoon.core.config import DriveModel, ImuModel, RobotConfig
from raccoon.core.readings import Device
from raccoon.estimate.ekf.filter import ProcessNoise
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import SIZE, OdometrySettings, State
from raccoon.model.bemf import counts_scale

_SCALES = [State.WAY, State.BALANCE, State.WHEEL_TURN]
_TURNS = [State.WHEEL_TURN, State.GYRO_SCALE], [State.GYRO_SCALE, State.WHEEL_TURN]


def prior(robot: RobotConfig, settings: OdometrySettings, device: Device) -> tuple[Array, Array]:
    """Mean (13,) and covariance (13, 13) of the state of a robot that stands at the origin."""
    mean = np.zeros(SIZE)
    deviations = np.zeros(SIZE)
    imu = robot.model.imu
    mean[State.GYRO_BIAS] = imu.gyro_bias.value
    mean[State.GYRO_SCALE] = imu.gyro_scale.value
    mean[[State.WAY, State.WHEEL_TURN]] = 1.0
    deviations[[State.X, State.Y, State.HEADING]] = 1e-4
    deviations[State.VELOCITY], deviations[State.TURN_RATE] = 0.1, 0.5
    deviations[State.GYRO_BIAS] = max(imu.gyro_bias.std, settings.gyro_bias)
    deviations[State.GYRO_SCALE] = max(gyro_scale_std(robot, settings), 1e-5)
    deviations[State.GYRO_DELAY] = settings.gyro_delay
    for side, offset in (("left", State.LEFT_OFFSET), ("right", State.RIGHT_OFFSET)):
        deviations[offset] = offset_std_counts(robot, settings, side) * counts_scale(robot, side, device)
    covariance = np.diag(deviations**2)
    scales = [scale_std(robot, settings, side) for side in ("left", "right")]
    covariance[np.ix_(_SCALES, _SCALES)] = scale_covariance(scales[0], scales[1], track_std(robot, settings))
    # The wheels' turn is known only relative to the gyro: a track width is fitted to the gyro's turns. So the
    # two scales are correlated, the wheels do not correct the gyro's scale, and a wrong track width does not
    # turn the robot.
    gyro = deviations[State.GYRO_SCALE] / imu.gyro_scale.value
    covariance[State.WHEEL_TURN, State.WHEEL_TURN] += gyro**2
    covariance[_TURNS] = gyro * deviations[State.GYRO_SCALE]
    return mean, covariance


def scale_covariance(left: float, right: float, track: float) -> Array:
    """Covariance (3, 3) of WAY, BALANCE and WHEEL_TURN from the relative standard deviations of both wheel
    scales and of the track width.

    With scales 1 + l and 1 + r and a track 1 + t, to first order: WAY = 1 - (l + r) / 2, BALANCE = (r - l) /
    2, WHEEL_TURN = 1 + (l + r) / 2 + t.
    """
    slopes = np.array([[-0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.5, 0.5, 1.0]])
    found: Array = slopes @ np.diag([left**2, right**2, track**2]) @ slopes.T
    return found


def offset_std_counts(robot: RobotConfig, settings: OdometrySettings, side: str) -> float:
    """Standard deviation of a motor's back-EMF offset, counts; 0 means exactly no offset (an encoder)."""
    known = known_offset_std(robot, side)
    return max(robot.model.bemf.offset.std, settings.uncalibrated_offset_counts) if known is None else known


def known_offset_std(robot: RobotConfig, side: str) -> float | None:
    """Standard deviation of this motor's offset in robot.toml, counts; None if it gives no offset.

    An offset given as a plain number has the model's standard deviation: offsets of motors change.
    """
    own = robot.wheel_motor(side).bemf_offset
    return None if own is None else own.std or (robot.model.bemf.offset.std if own.value else 0.0)


def gyro_scale_std(robot: RobotConfig, settings: OdometrySettings) -> float:
    """Standard deviation of the gyro's scale.

    A scale without a standard deviation, or equal to the default, was not measured: then the setting
    `uncalibrated_gyro_scale` holds.
    """
    scale = robot.model.imu.gyro_scale
    if scale.std > 0.0 and scale != ImuModel().gyro_scale:
        return scale.std
    return settings.uncalibrated_gyro_scale * scale.value


def track_std(robot: RobotConfig, settings: OdometrySettings) -> float:
    """Relative standard deviation of the track width.

    Without a date or a standard deviation of its own in robot.toml it was not measured by driving, at most
    with a ruler, and the wheels touch the floor somewhere within their width.
    """
    track, nominal = robot.model.drive.track_width, DriveModel().track_width
    measured = track.date is not None or track.std not in (0.0, nominal.std)
    return max(track.std / track.value, 1e-4 if measured else settings.uncalibrated_track)


def scale_std(robot: RobotConfig, settings: OdometrySettings, side: str) -> float:
    """Relative standard deviation of a wheel's metres per count · second."""
    own = robot.wheel_motor(side).radians_per_tick
    if own is not None:
        return max(own.std / own.value, settings.calibrated_scale)
    radius, constant = robot.model.drive.wheel_radius, getattr(robot.model, side).back_emf_constant
    known = float(np.hypot(radius.std / radius.value, constant.std / constant.value))
    return float(max(known, settings.uncalibrated_scale))


def process_noise(robot: RobotConfig, settings: OdometrySettings, radians_per_count: float) -> ProcessNoise:
    """Process noise of the state. radians_per_count: wheel speed of one back-EMF count, rad/s.

    An offset that is exactly known (an encoder's) does not wander.
    """
    offset_std = max(offset_std_counts(robot, settings, side) for side in ("left", "right"))
    walk = settings.offset_walk_counts if offset_std > 0.0 else 0.0
    return ProcessNoise(
        velocity=settings.acceleration**2,
        turn_rate=settings.turn_acceleration**2,
        gyro_bias=settings.gyro_bias_walk**2,
        offset=(walk * radians_per_count) ** 2,
        scale=0.5 * settings.scale_walk**2,
    )
