"""Standard deviations of the fitted drive geometry, by the jackknife."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.estimate.drive.prior import gyro_scale_std
from raccoon.estimate.drive_calibration.columns import Array, Manoeuvre
from raccoon.estimate.drive_calibration.paths import residuals, start_pose_changes
from raccoon.estimate.ekf.state import OdometrySettings

JACKKNIFE_PARTS = 8
"""Least number of parts left out in turn: fewer may agree by chance and give a tenth of the true standard
deviation."""


def jackknife_deviations(
    robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], factors: Array, fitted: Sequence[Manoeuvre]
) -> Array:
    """Relative standard deviations (3,) by the jackknife: the change of the fit when one part is left out.

    fitted: the recordings or pieces that the factors were fitted to. Each refit is one Gauss-Newton step from
    the whole fit, which is as good as a refit this near. They are widened by the variance of Student's t for
    so few parts.
    """
    parts, kept = split_into_parts(manoeuvres)
    square = _jackknife_variances(robot, parts, kept, factors) * (len(parts) - 1) / (len(parts) - 3)
    if len(manoeuvres) > 1:  # recordings may differ in what is constant within each, like a changed wheel
        square = np.maximum(square, _jackknife_variances(robot, *_split_into_recordings(manoeuvres), factors))
    if not np.isfinite(square).all():
        return np.full(3, math.inf)
    if not any(each.truth is not None for each in manoeuvres):  # the gyro's scale is wrong in all parts alike
        square[2] += (gyro_scale_std(robot, OdometrySettings()) / robot.model.imu.gyro_scale.value) ** 2
    deviations: Array = np.sqrt(
        square + _start_variances(robot, fitted, factors) + _tape_variances(robot, fitted, factors)
    )
    return deviations


def _jackknife_variances(
    robot: RobotConfig, parts: Sequence[Manoeuvre], kept: Sequence[Manoeuvre], factors: Array
) -> Array:
    """Variances (3,) by the change of the fit without each part; infinite if the fit is impossible without
    one."""
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
    squares: Array = (len(parts) - 1) / len(parts) * (spread**2).sum(axis=0)
    return squares


def _start_variances(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], factors: Array) -> Array:
    """Variances (3,) from the error of each path's starting pose, which rotates all of the path, and a short
    piece less."""
    whole, each_start = np.zeros((3, 3)), []
    for each in manoeuvres:
        J = _jacobian(robot, each, factors)
        whole += J.T @ J
        if each.truth is not None and not each.taped:
            each_start.append(start_pose_changes(factors, robot, each) @ J)
    moved = np.linalg.solve(whole, np.concatenate([np.zeros((0, 3)), *each_start]).T)
    squares: Array = (moved**2).sum(axis=1)
    return squares


def _tape_variances(robot: RobotConfig, manoeuvres: Sequence[Manoeuvre], factors: Array) -> Array:
    """Variances (3,) from the error of each taped piece. Leaving out parts does not show it: the tape is
    never left out, and beside a reference it still has its weight."""
    whole = np.sum([_normal_equations(robot, each, factors)[0] for each in manoeuvres], axis=0)
    taped = [_jacobian(robot, each, factors) for each in _tapes(manoeuvres)]
    slopes = np.concatenate([np.zeros((0, 3)), *taped])
    squares: Array = (np.linalg.solve(whole, slopes.T) ** 2).sum(axis=1)
    return squares


def _normal_equations(robot: RobotConfig, part: Manoeuvre, factors: Array) -> tuple[Array, Array]:
    """J'J (3, 3) and J'r (3,) of a manoeuvre at these factors."""
    J = _jacobian(robot, part, factors)
    return J.T @ J, J.T @ residuals(factors, robot, part)


def _jacobian(robot: RobotConfig, part: Manoeuvre, factors: Array) -> Array:
    """Derivatives (n, 3) of its residuals by the factors."""
    here, step = residuals(factors, robot, part), 1e-5
    return np.column_stack(
        [(residuals(factors + step * row, robot, part) - here) / step for row in np.eye(3)]
    )


def split_into_parts(manoeuvres: Sequence[Manoeuvre]) -> tuple[list[Manoeuvre], list[Manoeuvre]]:
    """The parts to leave out in turn, recordings or pieces of them; and what is never left out: the tape."""
    each_in = math.ceil(JACKKNIFE_PARTS / len(manoeuvres))
    if each_in == 1:
        return _split_into_recordings(manoeuvres)
    pieces = []
    for whole in manoeuvres:
        edges = np.linspace(0, len(whole.t), each_in + 1).astype(int)
        pieces += [whole.piece(begin, end) for begin, end in pairwise(edges)]
    return pieces, _tapes(manoeuvres)


def _split_into_recordings(manoeuvres: Sequence[Manoeuvre]) -> tuple[list[Manoeuvre], list[Manoeuvre]]:
    """The recordings to leave out in turn; and what is never left out, if a single recording gives a length:
    its tape, or all of it if it has a reference."""
    if sum(each.truth is not None or len(each.taped) > 0 for each in manoeuvres) > 1:
        return list(manoeuvres), []
    seen = [each for each in manoeuvres if each.truth is not None]
    others = [replace(each, taped=()) for each in manoeuvres if each.truth is None]
    return others, seen or _tapes(manoeuvres)


def _tapes(manoeuvres: Sequence[Manoeuvre]) -> list[Manoeuvre]:
    """The recordings with a tape, each with nothing else that its path is compared with."""
    return [replace(each, gyro=None, truth=None) for each in manoeuvres if each.taped]
