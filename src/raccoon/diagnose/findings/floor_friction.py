"""Separation of the floor's friction in one recording from the robot's own, which is permanent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.linear_model import wheel_speed
from raccoon.diagnose.fit.noise_estimation import STANDSTILL_SHARE
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.wander import FLOOR_CORRELATION_S, covariance_of_sums
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

FRICTION_NUMBERS = (("friction.coulomb", "torque"), ("friction.viscous", "coefficient"))
"""The refitted numbers of a robot's friction: a line over speed at each wheel."""
COORDINATE_STEP = 1e-3
"""Difference step of a coordinate for the derivative of the friction line."""


def without_floor_friction(problem: Problem, point: Point, wander: float) -> Point:
    """A fitted point with the friction that is expected of the robot in future drives.

    A fit finds the friction of this recording. It is the sum of the robot's, a line F + d |w| over each
    wheel's speed with robot.toml's standard deviations (covariance P), and the least-squares line through the
    floor's contribution (covariance S), which is not permanent. The expected robot's part of the sum is P (P
    + S)^-1. The gain is in docs/decisions/0018-what-the-floor-did-is-left-out.md.

    wander: RMS size of slowly varying floor friction, relative to Coulomb friction.
    """
    moves = np.stack([_friction_line(problem, index) for index in range(len(problem.base))], axis=1)
    moving = np.flatnonzero(moves.any(axis=0))
    if len(moving) == 0:
        return point
    moves, floor_covariance = moves[:, moving], np.zeros((len(moves), len(moves)))
    measured = problem.features.measured
    for wheel, side in enumerate(SIDES):
        rows = slice(len(FRICTION_NUMBERS) * wheel, len(FRICTION_NUMBERS) * (wheel + 1))
        torque = wander * problem.neutral[("friction.coulomb", side, "torque")]
        speed = wheel_speed(problem, measured, side)
        speed = np.zeros(len(measured)) if speed is None else speed
        floor_covariance[rows, rows] = torque**2 * friction_line_covariance(problem.features.time, speed)
    base = point.base.copy()
    fitted_line, prior_covariance = moves @ base[moving], moves @ moves.T
    total_covariance = prior_covariance + floor_covariance
    expected = prior_covariance @ np.linalg.pinv(total_covariance, hermitian=True) @ fitted_line
    base[moving] += np.linalg.pinv(moves) @ (expected - fitted_line)
    return Point(base, point.active)


def friction_line_covariance(time: Array, speed: Array) -> Array:
    """Covariance (2, 2) of the coefficients of the least-squares line over |speed| (rad/s) through slowly
    varying floor friction of size 1 while a wheel moves. If the speed is not known (0), the line is the mean
    with slope 0."""
    moves = np.abs(speed) >= STANDSTILL_SHARE * np.abs(speed).max()
    line = np.stack([np.ones(int(moves.sum())), np.abs(speed[moves])], axis=1)
    return covariance_of_sums(np.linalg.pinv(line), time[moves], FLOOR_CORRELATION_S)


def _friction_line(problem: Problem, index: int) -> Array:
    """Change of each wheel's line per unit of a base coordinate, (wheels times two,)."""
    moved = dict(problem.neutral)
    problem.base[index].apply(moved, COORDINATE_STEP)
    keys = [(id_, side, name) for side in SIDES for id_, name in FRICTION_NUMBERS]
    return np.array([(moved[key] - problem.neutral[key]) / COORDINATE_STEP for key in keys])
