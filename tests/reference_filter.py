"""The drive filter with stock filterpy throughout: the reference that the generated code must equal, and
the clock it is measured against."""

from __future__ import annotations

from typing import Any

import numpy as np

from raccoon.estimate.ekf import model as drive_model
from raccoon.estimate.ekf.filter import ProcessNoise, filterpy_filter, flatten
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import State
from raccoon.model.drive import DriveGeometry

_WANDERING = (
    State.VELOCITY,
    State.TURN_RATE,
    State.GYRO_BIAS,
    State.LEFT_OFFSET,
    State.RIGHT_OFFSET,
    State.WAY,
    State.BALANCE,
    State.WHEEL_TURN,
)


def together(variances: tuple[float, ...], wobble: float) -> Array:
    """Covariance of the readings: wheels that wobble against each other, and a gyro where there is one."""
    noise: Array = np.diag(variances)
    noise[:2, :2] += wobble * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return noise


class ReferenceFilter:
    """`DriveFilter`'s every-cycle calls, by filterpy's own `predict` and `update`."""

    def __init__(self, mean: Array, covariance: Array, geometry: DriveGeometry, noise: ProcessNoise) -> None:
        self.geometry = geometry
        self._noise = noise
        self._ekf: Any = filterpy_filter(mean, covariance, 3)
        self._dt = 0.0
        self._ekf.predict_x = self._predict_state

    @property
    def flat(self) -> Flat:
        """The belief in the form `DriveFilter` keeps."""
        return flatten(self._ekf.x, self._ekf.P)

    def predict(self, dt: float) -> None:
        """Move on by dt s: P = F P F' + F Q F', as motion happens after the velocities have changed."""
        ekf = self._ekf
        velocity, turn_rate, gyro_bias, offset, scale = self._noise(dt)
        Q = np.zeros_like(ekf.P)
        Q[_WANDERING, _WANDERING] = (velocity, turn_rate, gyro_bias, offset, offset, scale, scale, scale)
        Q[State.WAY, State.WHEEL_TURN] = Q[State.WHEEL_TURN, State.WAY] = -scale
        ekf.F = drive_model.motion_jacobian(ekf.x, dt)
        ekf.Q = ekf.F @ Q @ ekf.F.T
        self._dt = dt
        ekf.predict()

    def step(
        self,
        dt: float,
        read: tuple[float, ...],
        variances: tuple[float, ...],
        swing: float,
        wobble: float = 0.0,
    ) -> None:
        """Move on and take both wheels and, where it is there, the gyro."""
        self.predict(dt)
        count, geometry, ekf = len(read), self.geometry, self._ekf
        if count < 3:
            swing = 0.0
        ekf.update(
            np.array(read),
            lambda x: drive_model.expected_readings_jacobian(x, geometry, swing)[:count],
            lambda x: drive_model.expected_readings(x, geometry, swing)[:count],
            R=together(variances, wobble),
        )

    def still(self, velocity_variance: float, turn_rate_variance: float) -> None:
        """Take it that the robot does not move."""
        H = np.zeros((2, len(self._ekf.x)))
        H[0, State.VELOCITY] = H[1, State.TURN_RATE] = 1.0
        R = np.diag([velocity_variance, turn_rate_variance])
        self._ekf.update(np.zeros(2), lambda _: H, lambda x: H @ x, R=R)

    def _predict_state(self, _: object = 0) -> None:
        self._ekf.x = drive_model.predict_state(self._ekf.x, self._dt)
