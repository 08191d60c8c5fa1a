"""The drive filter: an extended Kalman filter whose every-cycle algebra is unrolled.

`DriveFilter` holds a `filterpy.kalman.ExtendedKalmanFilter`. What comes every cycle (predict, wheels,
gyro, standing still) runs in `ekf.generated`, which does filterpy's arithmetic without its arrays; what
comes now and then (a wall, a line, a known pose, a taped distance) goes through filterpy itself, with the
full covariance and its Joseph form. A test holds the generated code to stock filterpy throughout.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from raccoon.estimate.ekf import generated
from raccoon.estimate.ekf.bridge import bridge_gap
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import SIZE, State
from raccoon.model.drive import DriveGeometry

_SLOW = [
    State.GYRO_BIAS,
    State.LEFT_OFFSET,
    State.RIGHT_OFFSET,
    State.WAY,
    State.BALANCE,
    State.WHEEL_TURN,
]
_ROWS, _COLUMNS = np.triu_indices(SIZE)


def flatten(mean: Array, covariance: Array) -> Flat:
    """State and upper triangle of the covariance as the generated code keeps them."""
    return (*map(float, mean), *map(float, covariance[_ROWS, _COLUMNS]))


def mean_of(flat: Flat) -> Array:
    """The state vector, (13,)."""
    return np.array(flat[:SIZE])


def covariance_of(flat: Flat) -> Array:
    """The covariance, (13, 13), symmetric."""
    P = np.zeros((SIZE, SIZE))
    P[_ROWS, _COLUMNS] = flat[SIZE:]
    P[_COLUMNS, _ROWS] = flat[SIZE:]
    return P


def variance_index(state: State) -> int:
    """Where the variance of a state stands in the flat state."""
    return covariance_index(state, state)


def covariance_index(row: State, column: State) -> int:
    """Where the covariance of two states, in their order, stands in the flat state."""
    return SIZE + row * SIZE - row * (row - 1) // 2 + column - row


class ProcessNoise:
    """Variances a second that the state wanders with; calling it with dt gives the arguments of `predict`."""

    __slots__ = ("_gyro_bias", "_offset", "_scale", "_turn_rate", "_velocity")

    def __init__(
        self, velocity: float, turn_rate: float, gyro_bias: float, offset: float, scale: float
    ) -> None:
        self._velocity = velocity
        self._turn_rate = turn_rate
        self._gyro_bias = gyro_bias
        self._offset = offset
        self._scale = scale

    def __call__(self, dt: float) -> tuple[float, float, float, float, float]:
        return (
            self._velocity * dt,
            self._turn_rate * dt,
            self._gyro_bias * dt,
            self._offset * dt,
            self._scale * dt,
        )


def filterpy_filter(mean: Array, covariance: Array, measurements: int) -> Any:
    """A stock filterpy EKF with this belief. Imports filterpy (2 s)."""
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(dim_x=SIZE, dim_z=measurements)
    ekf.x, ekf.P = mean.copy(), covariance.copy()
    return ekf


class DriveFilter:
    """Belief about the drive, moved on by one call a cycle.

    `flat` is an immutable value: keeping it is a snapshot, setting it goes back.
    """

    __slots__ = ("_ekf", "_half_track", "_noise", "_radius", "flat", "geometry")

    def __init__(self, mean: Array, covariance: Array, geometry: DriveGeometry, noise: ProcessNoise) -> None:
        if mean.shape != (SIZE,) or covariance.shape != (SIZE, SIZE):
            raise ValueError(f"shapes {mean.shape}, {covariance.shape}: ({SIZE},), ({SIZE}, {SIZE}) needed")
        self._ekf = filterpy_filter(mean, covariance, 1)
        self.flat = flatten(mean, covariance)
        self.geometry = geometry
        self._noise = noise
        self._radius = geometry.wheel_radius
        self._half_track = 0.5 * geometry.track_width

    def predict(self, dt: float) -> None:
        """Move on by dt s with nothing read."""
        self.flat = generated.predict(self.flat, dt, *self._noise(dt))

    def step(
        self,
        dt: float,
        read: tuple[float, ...],
        variances: tuple[float, ...],
        turn_acceleration: float,
        differential_variance: float = 0.0,
    ) -> Flat:
        """Move on by dt s and take left wheel, right wheel (rad/s, nominal scale) and, where it is there, the
        gyro (rad/s): means over dt.

        swing: rad/s2, how fast the turn rate changes; it says how far the gyro's delay can be seen. wobble:
        variance that either wheel's reading has besides, as much up as the other one's down.
        Gives innovation and its variance of left, right, gyro in turn, each after those before it.
        """
        gyro, of_gyro = None, 0.0
        if len(read) == 3:
            gyro, of_gyro = read[2], variances[2]
        else:
            turn_acceleration = 0.0
        self.predict(dt)
        self.flat, innovations = generated.update(
            self.flat,
            read[0],
            variances[0],
            read[1],
            variances[1],
            gyro,
            of_gyro,
            turn_acceleration,
            differential_variance,
            self._radius,
            self._half_track,
        )
        return innovations

    def bridge(
        self,
        dt: float,
        angles: tuple[float, float],
        variances: tuple[float, float],
        differential_variance: float,
        angle_covariance: float,
        motion: tuple[float, float],
    ) -> float:
        """Move on by dt s in which nobody looked, by the angles (rad, nominal) that both wheels turned; m.

        variances, wobble: of the angles, rad^2. together: their covariance besides. motion: m/s and rad/s
        that it has now, about.
        """
        _, _, gyro_bias, offset, scale = self._noise(dt)
        P = covariance_of(self.flat)
        P[_SLOW, _SLOW] += (gyro_bias, offset, offset, scale, scale, scale)
        P[State.WAY, State.WHEEL_TURN] -= scale
        P[State.WHEEL_TURN, State.WAY] -= scale
        noise = np.diag(variances) + differential_variance * np.array([[1.0, -1.0], [-1.0, 1.0]])
        noise[0, 1] += angle_covariance
        noise[1, 0] += angle_covariance
        mean, P, travel = bridge_gap(mean_of(self.flat), P, dt, angles, noise, self.geometry, motion[1])
        mean[[State.VELOCITY, State.TURN_RATE]] = motion
        self.flat = flatten(mean, P)
        return travel

    def apply_standstill(self, velocity_variance: float, turn_rate_variance: float) -> None:
        """Take it that the robot does not move."""
        self.flat = generated.update_still(self.flat, velocity_variance, turn_rate_variance)

    def observe(
        self,
        measured: Array,
        expected: Callable[[Array], Array],
        jacobian: Callable[[Array], Array],
        noise: Array,
        residual: Callable[[Array, Array], Array] = np.subtract,
    ) -> float:
        """Take an observation of (m,) values with filterpy; gives its Mahalanobis distance."""
        ekf = self._ekf
        ekf.x, ekf.P = mean_of(self.flat), covariance_of(self.flat)
        ekf.dim_z = len(measured)
        ekf.update(measured, jacobian, expected, R=noise, residual=residual)
        self.flat = flatten(ekf.x, 0.5 * (ekf.P + ekf.P.T))
        return float(ekf.mahalanobis)

    def set_pose(self, x: float, y: float, heading: float, std: float) -> None:
        """Take the pose to be this (m, m, rad; std in m and rad); nothing else changes."""
        mean, P = mean_of(self.flat), covariance_of(self.flat)
        pose = [State.X, State.Y, State.HEADING]
        mean[pose] = x, y, heading
        P[pose, :] = P[:, pose] = 0.0
        P[pose, pose] = std**2
        self.flat = flatten(mean, P)

    def copy_pose(self, flat: Flat) -> None:
        """Take the pose, and how sure it is, to be those of another belief; nothing else changes."""
        mean, P = mean_of(self.flat), covariance_of(self.flat)
        pose = slice(State.X, State.VELOCITY)
        mean[pose] = flat[pose]
        P[pose, :] = P[:, pose] = 0.0
        P[pose, pose] = covariance_of(flat)[pose, pose]
        self.flat = flatten(mean, P)

    def widen(self, states: tuple[State, ...], std: float) -> None:
        """Add this deviation to what is not known of some states."""
        flat = list(self.flat)
        for state in states:
            flat[variance_index(state)] += std**2
        self.flat = tuple(flat)

    def widen_along(self, ahead: float, aside: float = 0.0) -> None:
        """Add m^2 to what is not known of the place ahead, and to the side."""
        flat = list(self.flat)
        cosine, sine = math.cos(flat[State.HEADING]), math.sin(flat[State.HEADING])
        flat[variance_index(State.X)] += ahead * cosine * cosine + aside * sine * sine
        flat[variance_index(State.Y)] += ahead * sine * sine + aside * cosine * cosine
        flat[covariance_index(State.X, State.Y)] += (ahead - aside) * cosine * sine
        self.flat = tuple(flat)

    def widen_bias(self, std: float, seconds: float) -> None:
        """Add this deviation, rad/s, to what is not known of the gyro's bias, and what that has turned in so
        many s to what is not known of the heading."""
        flat, turned = list(self.flat), -std * seconds
        flat[variance_index(State.GYRO_BIAS)] += std * std
        flat[variance_index(State.HEADING)] += turned * turned
        flat[covariance_index(State.HEADING, State.GYRO_BIAS)] += std * turned
        self.flat = tuple(flat)

    def widen_scales(self, std: float) -> None:
        """Add this relative deviation to what is not known of either wheel's scale."""
        flat, each = list(self.flat), 0.5 * std**2
        for state in (State.WAY, State.BALANCE, State.WHEEL_TURN):
            flat[variance_index(state)] += each
        flat[covariance_index(State.WAY, State.WHEEL_TURN)] -= each
        self.flat = tuple(flat)

    def widen_way(self, wheel: float, turning: float) -> None:
        """Add these deviations to what is not known of WAY, as if it had been so from the beginning: all that
        was believed to hang together with it becomes as much less sure.

        wheel: because one wheel is another. turning: because both are, or the track: which of them no turn
        tells, and neither says anything of the gyro's scale and delay.
        """
        P = covariance_of(self.flat)
        if P[State.WAY, State.WAY] > 0.0:
            slope = P[State.WAY] / P[State.WAY, State.WAY]
            P += wheel**2 * np.outer(slope, slope)
            slope[[State.WHEEL_TURN, State.GYRO_SCALE, State.GYRO_DELAY]] = 0.0
            P += turning**2 * np.outer(slope, slope)
            self.flat = flatten(mean_of(self.flat), P)

    def copy_scales(self, flat: Flat) -> None:
        """Take the scales of wheels and track width to be those of another belief."""
        self.flat = (
            *self.flat[: State.WAY],
            *flat[State.WAY : State.GYRO_SCALE],
            *self.flat[State.GYRO_SCALE :],
        )
