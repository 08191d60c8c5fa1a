"""The drive filter's model with NumPy: motion, readings and their Jacobians, as stock filterpy wants them.

Readable twin of `ekf/generated.py`. With s the named states of `state.State`, b the track width and
r the wheel radius::

    left  = left_scale  (velocity - turn_rate track_scale b / 2) / r + left_offset
    right = right_scale (velocity + turn_rate track_scale b / 2) / r + right_offset
    gyro  = gyro_scale turn_rate + gyro_bias

A reading is the mean over the step that ends with it, and velocity and turn rate are constant within a step.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.ekf.state import SIZE, State
from raccoon.model.drive import DriveGeometry

Array = NDArray[np.float64]


def moved(state: Array, dt: float) -> Array:
    """State after dt s: the chord of the arc, along its middle heading (second order in the turn)."""
    result = state.copy()
    middle = state[State.HEADING] + 0.5 * dt * state[State.TURN_RATE]
    result[State.X] += state[State.VELOCITY] * dt * math.cos(middle)
    result[State.Y] += state[State.VELOCITY] * dt * math.sin(middle)
    result[State.HEADING] += dt * state[State.TURN_RATE]
    return result


def motion_jacobian(state: Array, dt: float) -> Array:
    """Derivative of `moved` by the state, (12, 12)."""
    F = np.eye(SIZE)
    middle = state[State.HEADING] + 0.5 * dt * state[State.TURN_RATE]
    along_x, along_y = dt * math.cos(middle), dt * math.sin(middle)
    velocity = state[State.VELOCITY]
    F[State.X, State.HEADING] = -velocity * along_y
    F[State.X, State.VELOCITY] = along_x
    F[State.X, State.TURN_RATE] = -0.5 * dt * velocity * along_y
    F[State.Y, State.HEADING] = velocity * along_x
    F[State.Y, State.VELOCITY] = along_y
    F[State.Y, State.TURN_RATE] = 0.5 * dt * velocity * along_x
    F[State.HEADING, State.TURN_RATE] = dt
    return F


def readings(state: Array, geometry: DriveGeometry) -> Array:
    """Left wheel, right wheel (rad/s at nominal scale) and gyro (rad/s) that the state makes."""
    side = 0.5 * geometry.track_width * state[State.TRACK_SCALE] * state[State.TURN_RATE]
    velocity, radius = state[State.VELOCITY], geometry.wheel_radius
    left = state[State.LEFT_SCALE] * (velocity - side) / radius + state[State.LEFT_OFFSET]
    right = state[State.RIGHT_SCALE] * (velocity + side) / radius + state[State.RIGHT_OFFSET]
    gyro = state[State.GYRO_SCALE] * state[State.TURN_RATE] + state[State.GYRO_BIAS]
    return np.array([left, right, gyro])


def readings_jacobian(
    state: Array, geometry: DriveGeometry, turning: tuple[float, float] | None = None
) -> Array:
    """Derivative of `readings` by the state, (3, 12).

    turning: left and right wheel speed, rad/s, by which a reading moves with its scale; None takes the
    state's own. The filter hands in averaged ones: with the newest, their noise times itself would move
    scales that nothing measures (the sum of both when driving straight).
    """
    H = np.zeros((3, SIZE))
    half, radius = 0.5 * geometry.track_width, geometry.wheel_radius
    turn_rate, track_scale = state[State.TURN_RATE], state[State.TRACK_SCALE]
    wheels = ((-1.0, State.LEFT_SCALE, State.LEFT_OFFSET), (1.0, State.RIGHT_SCALE, State.RIGHT_OFFSET))
    side = half * track_scale * turn_rate
    speeds = turning or ((state[State.VELOCITY] - side) / radius, (state[State.VELOCITY] + side) / radius)
    for row, (sign, scale, offset) in enumerate(wheels):
        H[row, State.VELOCITY] = state[scale] / radius
        H[row, State.TURN_RATE] = sign * state[scale] * half * track_scale / radius
        H[row, State.TRACK_SCALE] = sign * state[scale] * half * turn_rate / radius
        H[row, scale] = speeds[row]
        H[row, offset] = 1.0
    H[2, State.TURN_RATE] = state[State.GYRO_SCALE]
    H[2, State.GYRO_SCALE] = turn_rate
    H[2, State.GYRO_BIAS] = 1.0
    return H
