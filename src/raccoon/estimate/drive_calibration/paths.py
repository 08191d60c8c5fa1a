"""The path that wheels make of given factors on their ways and on the track, and what it is off by."""

from __future__ import annotations

import math

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.estimate.drive_calibration.columns import Array, Manoeuvre

PLACE_STD, HEADING_STD = 0.01, math.radians(1.0)
"""m and rad, what an integrated path is expected to be off by: weights of the fit."""
STRETCH = 1.5
"""s of a stretch whose turn is compared with the gyro's."""


def path(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """x, y, heading (n, 3) that the wheels of a manoeuvre make, from 0."""
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
    """What a manoeuvre's path is off by, each over what it is expected to be off by."""
    parts = []
    if each.truth is not None:
        errors = off_truth(factors, robot, each) / (PLACE_STD, PLACE_STD, HEADING_STD)
        parts.append(errors[1:].ravel() / math.sqrt(max(len(errors), 1)))
    elif each.gyro is not None:
        parts.append(_gyro_residuals(factors, robot, each, each.gyro))
    driven = path(factors, robot, each)
    for taped in each.taped:
        begin, end = np.searchsorted(each.t, [taped.begin, taped.end]).clip(0, len(each.t) - 1)
        chord = math.dist(driven[begin, :2], driven[end, :2])
        parts.append(np.array([(chord - abs(taped.distance)) / taped.std]))
    return np.concatenate(parts)


def off_truth(factors: Array, robot: RobotConfig, each: Manoeuvre) -> Array:
    """Path minus truth, x, y, heading, in its known rows (k, 3); the first of them is where it starts.

    Raises CalibrationError for a manoeuvre without truth.
    """
    if each.truth is None:
        raise CalibrationError("a recording has no truth.x, truth.y and truth.heading")
    truth, driven = each.truth[each.known], path(factors, robot, each)[each.known]
    if not len(truth):
        return truth
    turned, moved = truth[0, 2] - driven[0, 2], driven - driven[0]
    c, s = math.cos(turned), math.sin(turned)
    x = truth[0, 0] + c * moved[:, 0] - s * moved[:, 1]
    y = truth[0, 1] + s * moved[:, 0] + c * moved[:, 1]
    return np.column_stack([x, y, truth[0, 2] + moved[:, 2]]) - truth


def _gyro_residuals(factors: Array, robot: RobotConfig, each: Manoeuvre, gyro: Array) -> Array:
    """Turn by the wheels minus turn by the gyro, stretch by stretch."""
    times = np.arange(each.t[0], each.t[-1], STRETCH)
    ends = np.append(np.searchsorted(each.t, times), len(each.t) - 1)
    heading = path(factors, robot, each)[:, 2]
    turns: Array = (np.diff(heading[ends]) - np.diff(gyro[ends])) / HEADING_STD
    return turns
