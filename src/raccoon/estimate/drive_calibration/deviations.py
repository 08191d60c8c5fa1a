"""How sure the fitted geometry of a drive is: by leaving out a part of what it was fitted to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.estimate.drive_calibration.columns import Array, Manoeuvre
from raccoon.estimate.drive_calibration.paths import residuals


def left_out(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], factors: Array) -> Array:
    """Relative deviations (3,) by the jackknife: how far the fit moves when one recording is left out.

    Each refit is one Gauss-Newton step from the whole fit, which is as good as a refit this near.
    """
    parts, kept = _parts(manoeuvres)
    normal = [_normal_equations(robot, part, factors) for part in parts]
    always = [_normal_equations(robot, part, factors) for part in kept]
    whole_A = np.sum([A for A, _ in normal + always], axis=0)
    whole_b = np.sum([b for _, b in normal + always], axis=0)
    moved = []
    for A, b in normal:
        rest = whole_A - A
        if np.linalg.cond(rest) > 1e10:
            return np.full(3, math.inf)
        moved.append(-np.linalg.solve(rest, whole_b - b))
    spread = np.array(moved) - np.mean(moved, axis=0)
    count = len(normal)
    common = np.zeros(3)  # what is wrong with all parts alike: the tape, and for the track the gyro's scale
    if not any(each.truth is not None for each in manoeuvres):
        tape = [taped.std / abs(taped.distance) for each in manoeuvres for taped in each.taped]
        scale = robot.model.imu.gyro_scale
        common += min(tape) / math.sqrt(len(tape))
        common[2] = math.hypot(common[2], scale.std / scale.value)
    deviations: Array = np.sqrt((count - 1) / count * (spread**2).sum(axis=0) + common**2)
    return deviations


def _normal_equations(robot: RobotConfig, part: Manoeuvre, factors: Array) -> tuple[Array, Array]:
    """J'J (3, 3) and J'r (3,) of a manoeuvre at these factors."""
    here, step = residuals(factors, robot, part), 1e-5
    J = np.column_stack([(residuals(factors + step * row, robot, part) - here) / step for row in np.eye(3)])
    return J.T @ J, J.T @ here


def _parts(manoeuvres: Sequence[Manoeuvre]) -> tuple[list[Manoeuvre], list[Manoeuvre]]:
    """What is left out in turn, a recording or a fifth of a single one, and what never is: its tape."""
    if len(manoeuvres) > 1:
        return list(manoeuvres), []
    whole = manoeuvres[0]
    edges = np.linspace(0, len(whole.t), 6).astype(int)
    pieces = [whole.piece(begin, end) for begin, end in pairwise(edges)]
    return pieces, [replace(whole, gyro=None, truth=None)] if whole.taped else []
