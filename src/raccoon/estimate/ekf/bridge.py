"""The drive filter over a gap in the readings: dead reckoning by the angles that both wheels turned.

A step of the filter assumes constant velocity and turn rate, predicted from the step before. Over a pause
neither holds: a robot that turned, stopped and stood for ten seconds would first be turned for ten seconds,
and the update would take that back along a straight line. Here the counters move it, with A the wheels'
angles over T s, lo and ro the offsets, b the track width, r the wheel radius::

    left  = r (A_left - lo T) / (1 - balance)        right = r (A_right - ro T) / (1 + balance)
    travel = way (left + right) / 2                   turn  = (right - left) / (wheel_turn b)
"""

from __future__ import annotations

import math

import numpy as np

from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import SIZE, State
from raccoon.model.drive import DriveGeometry, arc_end

UNKNOWN_VELOCITY, UNKNOWN_TURN_RATE = 0.5, 5.0
"""m/s and rad/s, standard deviations after the gap: the next step measures both."""

_POSE = [State.X, State.Y, State.HEADING]
_MOTION = [State.VELOCITY, State.TURN_RATE]


def bridge_gap(
    mean: Array,
    covariance: Array,
    seconds: float,
    angles: tuple[float, float],
    noise: Array,
    geometry: DriveGeometry,
    turn_rate: float,
) -> tuple[Array, Array, float]:
    """Mean (13,) and covariance (13, 13) after `seconds` s, and the travel in m.

    covariance: including the random walks over the gap. angles: rad that the wheels turned, at nominal scale.
    noise: their covariance (2, 2), rad^2. turn_rate: rad/s, approximate turn rate at the end. Velocity and
    turn rate are unknown afterwards.
    """
    travel, turn, slopes, of_angles = _wheel_motion(mean, seconds, angles, geometry, turn_rate)
    heading = mean[State.HEADING]
    x, y, after = arc_end(mean[State.X], mean[State.Y], heading, travel, turn)
    moved = mean.copy()
    moved[_POSE] = x, y, after
    moved[_MOTION] = 0.0
    middle = heading + 0.5 * turn
    # Derivative of x, y and heading by travel and turn.
    pose = np.array(
        [
            [math.cos(middle), -0.5 * travel * math.sin(middle)],
            [math.sin(middle), 0.5 * travel * math.cos(middle)],
            [0.0, 1.0],
        ]
    )
    F = np.eye(SIZE)
    F[_POSE] += pose @ slopes
    F[State.X, State.HEADING] -= y - mean[State.Y]
    F[State.Y, State.HEADING] += x - mean[State.X]
    P: Array = F @ covariance @ F.T
    by_angles = pose @ of_angles
    P[np.ix_(_POSE, _POSE)] += by_angles @ noise @ by_angles.T
    # Nobody knows whether it turned before, during or after its travel.
    aside = travel * min(0.5 * abs(turn), 1.0) / math.sqrt(3.0)
    P[State.X, State.X] += aside**2
    P[State.Y, State.Y] += aside**2
    P[_MOTION, :] = P[:, _MOTION] = 0.0
    P[_MOTION, _MOTION] = UNKNOWN_VELOCITY**2, UNKNOWN_TURN_RATE**2
    return moved, 0.5 * (P + P.T), float(travel)


def _wheel_motion(
    mean: Array, seconds: float, angles: tuple[float, float], geometry: DriveGeometry, turn_rate: float
) -> tuple[float, float, Array, Array]:
    """Travel (m), turn (rad), and their derivatives by the state (2, 13) and by both angles (2, 2)."""
    radius, balance = geometry.wheel_radius, mean[State.BALANCE]
    of_left, of_right = radius / (1.0 - balance), radius / (1.0 + balance)
    left = of_left * (angles[0] - mean[State.LEFT_OFFSET] * seconds)
    right = of_right * (angles[1] - mean[State.RIGHT_OFFSET] * seconds)
    way, track = mean[State.WAY], geometry.track_width * mean[State.WHEEL_TURN]
    turn = (right - left) / track
    # The wheels are ahead of the heading (at the gyro's time), before and after the gap.
    slower = mean[State.TURN_RATE] - turn_rate
    early = mean[State.GYRO_DELAY] * slower
    # Travel and turn by both wheels' distances.
    combined = np.array([[0.5 * way, 0.5 * way], [-1.0 / track, 1.0 / track]])
    of_angles: Array = combined * np.array([of_left, of_right])
    slopes = np.zeros((2, SIZE))
    slopes[:, State.LEFT_OFFSET] = -seconds * of_angles[:, 0]
    slopes[:, State.RIGHT_OFFSET] = -seconds * of_angles[:, 1]
    slopes[:, State.BALANCE] = combined @ np.array([left / (1.0 - balance), -right / (1.0 + balance)])
    slopes[0, State.WAY] = 0.5 * (left + right)
    slopes[1, State.WHEEL_TURN] = -turn / mean[State.WHEEL_TURN]
    slopes[1, State.GYRO_DELAY] = slower
    return 0.5 * way * (left + right), turn + early, slopes, of_angles
