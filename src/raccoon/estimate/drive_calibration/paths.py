"""The path that the wheels give with factors on their distances and the track width, and its residuals."""

from __future__ import annotations

import math

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.estimate.drive_calibration.columns import Array, Manoeuvre

PLACE_STD, HEADING_STD = 0.01, math.radians(1.0)
"""m and rad, expected errors of an integrated path: weights of the fit."""
STRETCH_S = 1.5
"""s, length of a stretch whose turn is compared with the gyro's."""
START_S = 0.5
"""s at the beginning of a path over which the reference gives its starting pose."""
MIN_AT_START = 4
"""Least number of rows in that time whose scatter gives the standard deviation of that pose."""


def integrate_path(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """x, y, heading (n, 3) by the wheels of a manoeuvre, from 0."""
    drive = robot.model.drive
    left = factors[0] * drive.wheel_radius.value * np.diff(each.left)
    right = factors[1] * drive.wheel_radius.value * np.diff(each.right)
    turn = (right - left) / (factors[2] * drive.track_width.value)
    heading = np.concatenate([[0.0], np.cumsum(turn)])
    middle = heading[:-1] + 0.5 * turn
    way = 0.5 * (left + right)
    x = np.concatenate([[0.0], np.cumsum(way * np.cos(middle))])
    y = np.concatenate([[0.0], np.cumsum(way * np.sin(middle))])
    return np.column_stack([x, y, heading])


def residuals(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """Residuals of a manoeuvre's path, each divided by its expected standard deviation."""
    parts = []
    if each.truth is not None:
        errors = truth_residuals(factors, robot, each) / (PLACE_STD, PLACE_STD, HEADING_STD)
        parts.append(errors.ravel() / math.sqrt(max(len(errors), 1)))
    elif each.gyro is not None:
        parts.append(_gyro_residuals(factors, robot, each, each.gyro))
    driven = integrate_path(factors, robot, each)
    for taped in each.taped:
        begin, end = np.searchsorted(each.t, [taped.begin, taped.end]).clip(0, len(each.t) - 1)
        chord = math.dist(driven[begin, :2], driven[end, :2])
        parts.append(np.array([(chord - abs(taped.distance)) / taped.std]))
    return np.concatenate(parts)


def truth_residuals(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """Path minus truth, x, y, heading, in the known rows (k, 3), from the pose in which the path starts.

    That pose is the mean over the first half second: from a single row, the reference's heading error (0.3
    degrees) would rotate the whole path. Raises CalibrationError for a manoeuvre without truth.
    """
    if each.truth is None:
        raise CalibrationError("a recording has no truth.x, truth.y and truth.heading")
    known = each.known_rows
    truth, driven = each.truth[known], integrate_path(factors, robot, each)[known]
    if not len(truth):
        return truth
    first = each.t[known] <= each.t[known[0]] + START_S
    turned = float(np.mean(truth[first, 2] - driven[first, 2]))
    c, s = math.cos(turned), math.sin(turned)
    x, y = c * driven[:, 0] - s * driven[:, 1], s * driven[:, 0] + c * driven[:, 1]
    off = np.column_stack([x, y, driven[:, 2] + turned]) - truth
    off[:, :2] -= off[first, :2].mean(axis=0)
    return off


def shape_residuals(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """Path minus truth as `truth_residuals`, but from the starting pose for which the whole path fits best.

    Raises CalibrationError for a manoeuvre without truth.
    """
    off = truth_residuals(factors, robot, each)
    if not len(off):
        return off
    weights = np.array([PLACE_STD, PLACE_STD, HEADING_STD])
    columns = (_pose_derivatives(each) / weights).reshape(3, -1).T
    pose, *_ = np.linalg.lstsq(columns, (off / weights).ravel(), rcond=None)
    left: Array = off - np.tensordot(pose, _pose_derivatives(each), axes=1)
    return left


def start_pose_changes(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """Changes of the residuals (3, n) of a manoeuvre with truth for one standard deviation of its starting x,
    y and heading, by the scatter of the rows that give them. Empty for too few rows."""
    off = truth_residuals(factors, robot, each)
    first = each.t[each.known_rows] <= each.t[each.known_rows[0]] + START_S if len(off) else np.zeros(0, bool)
    if first.sum() < MIN_AT_START:
        return np.zeros((0, 3 * len(off)))
    stds = off[first].std(axis=0, ddof=1) / math.sqrt(float(first.sum()))
    weights = np.array([PLACE_STD, PLACE_STD, HEADING_STD]) * math.sqrt(len(off))
    changes: Array = (stds[:, None, None] * _pose_derivatives(each) / weights).reshape(3, -1)
    return changes


def _pose_derivatives(each: Manoeuvre) -> Array:
    """Change (3, k, 3) of x, y, heading in the known rows for a start moved along x, along y, and rotated."""
    if each.truth is None:
        return np.zeros((3, 0, 3))
    x, y = (each.truth[each.known_rows, :2] - each.truth[each.known_rows[0], :2]).T
    zero, one = np.zeros(len(x)), np.ones(len(x))
    return np.array([[one, zero, zero], [zero, one, zero], [-y, x, one]]).transpose(0, 2, 1)


def _gyro_residuals(factors: Array, robot: RobotConfig, each: Manoeuvre, gyro: Array) -> Array:
    """Turn by the wheels minus turn by the gyro, stretch by stretch."""
    times = np.arange(each.t[0], each.t[-1], STRETCH_S)
    ends = np.append(np.searchsorted(each.t, times), len(each.t) - 1)
    heading = integrate_path(factors, robot, each)[:, 2]
    turns: Array = (np.diff(heading[ends]) - np.diff(gyro[ends])) / HEADING_STD
    return turns
