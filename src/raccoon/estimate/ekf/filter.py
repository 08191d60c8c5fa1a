"""The drive filter: an extended Kalman filter whose algebra of every cycle is unrolled.

`DriveFilter` holds a `filterpy.kalman.ExtendedKalmanFilter`. What comes in every cycle (prediction, wheels,
gyro, standstill) runs in `ekf.generated`, which does filterpy's arithmetic without its arrays. Occasional
observations (a wall, a line, a known pose, a taped distance) go through filterpy itself, with the full
covariance and its Joseph form. A test compares the generated code with stock filterpy.
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
    """State (13,) and upper triangle of the covariance (13, 13), in the order of the generated code."""
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
    """Index of a state's variance in the flat state."""
    return covariance_index(state, state)


def covariance_index(row: State, column: State) -> int:
    """Index of the covariance of two states, in their order, in the flat state."""
    return SIZE + row * SIZE - row * (row - 1) // 2 + column - row


class ProcessNoise:
    """Variances per second of the states' random walks; a call with dt gives the arguments of `predict`."""

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
    """A stock filterpy EKF with this state and covariance. Imports filterpy (2 s)."""
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(dim_x=SIZE, dim_z=measurements)
    ekf.x, ekf.P = mean.copy(), covariance.copy()
    return ekf


class DriveFilter:
    """State and covariance of the drive, moved on by one call a step.

    `flat` is an immutable value: keeping it makes a snapshot, assigning it restores one.
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
        """Move on by dt s without a reading."""
        self.flat = generated.predict(self.flat, dt, *self._noise(dt))

    def step(
        self,
        dt: float,
        read: tuple[float, ...],
        variances: tuple[float, ...],
        turn_acceleration: float,
        differential_variance: float = 0.0,
    ) -> Flat:
        """Move on by dt s and update with the left wheel, the right wheel (rad/s, nominal scale) and, if
        present, the gyro (rad/s): means over dt.

        turn_acceleration: change of the turn rate, rad/s2; it makes the gyro's delay observable.
        differential_variance: of an error that adds to one wheel's reading and subtracts from the other's.
        Returns innovation and variance of left, right and gyro in turn, each after the updates before it.
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
        """Move on over a gap of dt s by the angles (rad, nominal scale) that both wheels turned; returns the
        travel, m.

        variances, differential_variance: of the angles, rad^2. angle_covariance: their further covariance,
        rad^2. motion: approximate velocity (m/s) and turn rate (rad/s) at the end.
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
        """Update with a velocity and a turn rate of 0, with these variances."""
        self.flat = generated.update_still(self.flat, velocity_variance, turn_rate_variance)

    def observe(
        self,
        measured: Array,
        expected: Callable[[Array], Array],
        jacobian: Callable[[Array], Array],
        noise: Array,
        residual: Callable[[Array, Array], Array] = np.subtract,
    ) -> float:
        """Update with an observation of (m,) values through filterpy; returns its Mahalanobis distance."""
        ekf = self._ekf
        ekf.x, ekf.P = mean_of(self.flat), covariance_of(self.flat)
        ekf.dim_z = len(measured)
        ekf.update(measured, jacobian, expected, R=noise, residual=residual)
        self.flat = flatten(ekf.x, 0.5 * (ekf.P + ekf.P.T))
        return float(ekf.mahalanobis)

    def set_pose(self, x: float, y: float, heading: float, std: float) -> None:
        """Set the pose (m, m, rad; std in m and rad), without correlation; the rest stays."""
        mean, P = mean_of(self.flat), covariance_of(self.flat)
        pose = [State.X, State.Y, State.HEADING]
        mean[pose] = x, y, heading
        P[pose, :] = P[:, pose] = 0.0
        P[pose, pose] = std**2
        self.flat = flatten(mean, P)

    def copy_pose(self, flat: Flat) -> None:
        """Copy the pose and its covariance from another flat state; the rest stays."""
        mean, P = mean_of(self.flat), covariance_of(self.flat)
        pose = slice(State.X, State.VELOCITY)
        mean[pose] = flat[pose]
        P[pose, :] = P[:, pose] = 0.0
        P[pose, pose] = covariance_of(flat)[pose, pose]
        self.flat = flatten(mean, P)

    def widen(self, states: tuple[State, ...], std: float) -> None:
        """Add a standard deviation to some states."""
        flat = list(self.flat)
        for state in states:
            flat[variance_index(state)] += std**2
        self.flat = tuple(flat)

    def widen_along(self, ahead: float, aside: float = 0.0) -> None:
        """Add variances (m^2) to the position, along the heading and across it."""
        flat = list(self.flat)
        cosine, sine = math.cos(flat[State.HEADING]), math.sin(flat[State.HEADING])
        flat[variance_index(State.X)] += ahead * cosine * cosine + aside * sine * sine
        flat[variance_index(State.Y)] += ahead * sine * sine + aside * cosine * cosine
        flat[covariance_index(State.X, State.Y)] += (ahead - aside) * cosine * sine
        self.flat = tuple(flat)

    def widen_bias(self, std: float, seconds: float) -> None:
        """Add a standard deviation (rad/s) to the gyro's bias, and to the heading the turn that this bias
        made in `seconds` s, correlated with it."""
        flat, turned = list(self.flat), -std * seconds
        flat[variance_index(State.GYRO_BIAS)] += std * std
        flat[variance_index(State.HEADING)] += turned * turned
        flat[covariance_index(State.HEADING, State.GYRO_BIAS)] += std * turned
        self.flat = tuple(flat)

    def widen_scales(self, std: float) -> None:
        """Add a relative standard deviation to the scale of each wheel."""
        flat, each = list(self.flat), 0.5 * std**2
        for state in (State.WAY, State.BALANCE, State.WHEEL_TURN):
            flat[variance_index(state)] += each
        flat[covariance_index(State.WAY, State.WHEEL_TURN)] -= each
        self.flat = tuple(flat)

    def widen_way(self, wheel: float, turning: float) -> None:
        """Add standard deviations to WAY as if they had been there from the beginning: the states correlated
        with it become more uncertain accordingly.

        wheel: because a single wheel's scale is wrong. turning: because both scales or the track width are
        wrong; no turn shows which, and neither affects the gyro's scale and delay.
        """
        P = covariance_of(self.flat)
        if P[State.WAY, State.WAY] > 0.0:
            slope = P[State.WAY] / P[State.WAY, State.WAY]
            P += wheel**2 * np.outer(slope, slope)
            slope[[State.WHEEL_TURN, State.GYRO_SCALE, State.GYRO_DELAY]] = 0.0
            P += turning**2 * np.outer(slope, slope)
            self.flat = flatten(mean_of(self.flat), P)

    def copy_scales(self, flat: Flat) -> None:
        """Copy the scales of wheels and track width from another flat state."""
        self.flat = (
            *self.flat[: State.WAY],
            *flat[State.WAY : State.GYRO_SCALE],
            *self.flat[State.GYRO_SCALE :],
        )
