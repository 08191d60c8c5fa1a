"""The drive filter's model in NumPy: motion, readings and their Jacobians, as stock filterpy takes them.

The readable equivalent of `ekf/generated.py`. With the named states of `state.State`, b the track width and r
the wheel radius::

    turn  = wheel_turn (turn_rate + gyro_delay turn_acceleration)
    left  = (1 - balance) (velocity - turn b / 2) / r + left_offset
    right = (1 + balance) (velocity + turn b / 2) / r + right_offset
    gyro  = gyro_scale turn_rate + gyro_bias
    way in dt = way velocity dt

A reading is the mean over the step that ends with it, and velocity and turn rate are constant within a step.
The turn rate is that at the gyro's time; turn_acceleration is its change over the step, rad/s2. The wheels
are ahead of the gyro by gyro_delay, so their turn rate differs by gyro_delay turn_acceleration.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raccoon.estimate.ekf.state import MIN_TURN, MIN_VELOCITY, SIZE, State
from raccoon.model.drive import DriveGeometry

Array = NDArray[np.float64]


def predict_state(state: Array, dt: float) -> Array:
    """State after dt s: the chord of the arc, along its middle heading (second order in the turn)."""
    result = state.copy()
    middle = state[State.HEADING] + 0.5 * dt * state[State.TURN_RATE]
    way = state[State.WAY] * state[State.VELOCITY] * dt
    result[State.X] += way * math.cos(middle)
    result[State.Y] += way * math.sin(middle)
    result[State.HEADING] += dt * state[State.TURN_RATE]
    return result


def motion_jacobian(state: Array, dt: float) -> Array:
    """Derivative of `predict_state` by the state, (13, 13)."""
    F = np.eye(SIZE)
    middle = state[State.HEADING] + 0.5 * dt * state[State.TURN_RATE]
    along_x, along_y = dt * math.cos(middle), dt * math.sin(middle)
    way, read = state[State.WAY], state[State.VELOCITY]
    velocity = way * read
    F[State.X, State.HEADING] = -velocity * along_y
    F[State.X, State.VELOCITY] = way * along_x
    F[State.X, State.WAY] = read * along_x
    F[State.X, State.TURN_RATE] = -0.5 * dt * velocity * along_y
    F[State.Y, State.HEADING] = velocity * along_x
    F[State.Y, State.VELOCITY] = way * along_y
    F[State.Y, State.WAY] = read * along_y
    F[State.Y, State.TURN_RATE] = 0.5 * dt * velocity * along_x
    F[State.HEADING, State.TURN_RATE] = dt
    return F


def expected_readings(state: Array, geometry: DriveGeometry, turn_acceleration: float = 0.0) -> Array:
    """Left wheel, right wheel (rad/s at nominal scale) and gyro (rad/s) that the state predicts."""
    turn_rate = state[State.TURN_RATE] + state[State.GYRO_DELAY] * turn_acceleration
    side = 0.5 * geometry.track_width * state[State.WHEEL_TURN] * turn_rate
    velocity, radius, balance = state[State.VELOCITY], geometry.wheel_radius, state[State.BALANCE]
    left = (1.0 - balance) * (velocity - side) / radius + state[State.LEFT_OFFSET]
    right = (1.0 + balance) * (velocity + side) / radius + state[State.RIGHT_OFFSET]
    gyro = state[State.GYRO_SCALE] * state[State.TURN_RATE] + state[State.GYRO_BIAS]
    return np.array([left, right, gyro])


def expected_readings_jacobian(
    state: Array, geometry: DriveGeometry, turn_acceleration: float = 0.0
) -> Array:
    """Derivative of `expected_readings` by the state, (3, 13). turn_acceleration: change of the turn rate,
    rad/s2.

    A velocity up to MIN_VELOCITY has no information on BALANCE, a turn rate up to MIN_TURN none on WHEEL_TURN
    and GYRO_SCALE: there these derivatives are 0.
    """
    H = np.zeros((3, SIZE))
    half, radius = 0.5 * geometry.track_width, geometry.wheel_radius
    wheel_turn = state[State.WHEEL_TURN]
    turn_rate = state[State.TURN_RATE] + state[State.GYRO_DELAY] * turn_acceleration
    velocity = state[State.VELOCITY] * (abs(state[State.VELOCITY]) > MIN_VELOCITY)
    tells = abs(state[State.TURN_RATE]) > MIN_TURN
    for row, (sign, offset) in enumerate(((-1.0, State.LEFT_OFFSET), (1.0, State.RIGHT_OFFSET))):
        share = (1.0 + sign * state[State.BALANCE]) / radius
        H[row, State.VELOCITY] = share
        H[row, State.TURN_RATE] = sign * share * half * wheel_turn
        H[row, State.GYRO_DELAY] = sign * share * half * wheel_turn * turn_acceleration
        H[row, State.WHEEL_TURN] = sign * share * half * turn_rate * tells
        H[row, State.BALANCE] = sign * (velocity + sign * half * wheel_turn * turn_rate) / radius
        H[row, offset] = 1.0
    H[2, State.TURN_RATE] = state[State.GYRO_SCALE]
    H[2, State.GYRO_SCALE] = state[State.TURN_RATE] * tells
    H[2, State.GYRO_BIAS] = 1.0
    return H
