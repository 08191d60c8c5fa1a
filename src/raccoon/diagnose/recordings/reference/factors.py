"""Factors on gyro, track width and wheels, determined by a reference of the pose."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device
from raccoon.diagnose.recordings.reference.stretches import (
    MIN_DISTANCE,
    MIN_SAMPLES,
    MIN_TURN,
    Columns,
    PoseStretches,
    cut_stretches,
)
from raccoon.diagnose.recordings.reference.units import check_stretches

Array = NDArray[np.float64]

MAX_STD = 0.02
"""Largest relative standard deviation of a factor that counts as determined."""
MIN_STD = 0.001
"""Lower bound of a factor's standard deviation: filters and lags differ between turns by as much."""
TUKEY_CONSTANT, MAD_TO_STD, SMALL_SAMPLE_CORRECTION, REWEIGHTINGS = 4.685, 1.4826, 5.0, 40
"""Tukey's constant, with 95 % efficiency for normal errors; ratio of standard deviation to median absolute
deviation, and its correction for small samples (Rousseeuw and Leroy 1987); number of reweighting
iterations."""
MIN_INFLUENCE_SLOPE = 0.2
"""Least mean slope of Tukey's influence function (1 without outliers); below it too much was left out."""


@dataclass(frozen=True, slots=True)
class Factor:
    """A value over the assumed one, with its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True, slots=True)
class ReferenceFactors:
    """Factors by a reference, None if it does not determine them.

    gyro: gyro reading over turn rate. track: track width over robot.toml's. left, right: distance of a wheel
    over that by its reading at robot.toml's radius and K_E. wheel_ratio: right over left, which is known
    better than either.
    """

    gyro: Factor | None = None
    track: Factor | None = None
    left: Factor | None = None
    right: Factor | None = None
    wheel_ratio: Factor | None = None


def factors_of_reference(columns: Columns, robot: RobotConfig, device: Device) -> ReferenceFactors:
    """The factors by a recording's `truth.*` columns.

    Raises TraceError that names a column in another unit or mirrored.
    """
    stretches = cut_stretches(columns, robot, device)
    if stretches is None:
        return ReferenceFactors()
    check_stretches(stretches, columns, robot, device)
    found = ReferenceFactors(gyro=_gyro_factor(stretches, robot))
    if stretches.way is None or stretches.wheels is None or float(np.abs(stretches.way).sum()) < MIN_DISTANCE:
        return found
    way, rise = stretches.wheels
    dt, track = stretches.seconds[:, None], robot.model.drive.track_width.value
    by_way = _fit_robustly(np.hstack([way, rise, dt]) / 2.0, stretches.way)
    by_turn = _fit_robustly(np.hstack([way, rise, dt]) * [-1.0, 1.0, -1.0, 1.0, 1.0] / track, stretches.turn)
    if by_way is None or by_turn is None:
        return found
    mean_length, mean_turn = _mean_factor(by_way), _mean_factor(by_turn)
    if not (mean_turn.value > 0.0 and mean_length.value > 0.0):  # for example a robot that never turned
        return found
    track_factor = Factor(
        mean_length.value / mean_turn.value, math.hypot(mean_length.std, mean_turn.std, MIN_STD)
    )
    if not track_factor.std < MAX_STD:
        return found
    track_factor = replace(track_factor, std=track_factor.std * track_factor.value)
    sides = [_wheel_factor(by_turn, index, track_factor) for index in (0, 1)]
    return replace(
        found, track=track_factor, left=sides[0], right=sides[1], wheel_ratio=_wheel_ratio(by_turn)
    )


def _gyro_factor(stretches: PoseStretches, robot: RobotConfig) -> Factor | None:
    # From a quarter turn on the reference's unit is checked; the standard deviation decides on the rest.
    if stretches.gyro is None or float(np.abs(stretches.turn).sum()) < MIN_TURN / 2.0:
        return None
    turned, rise = stretches.gyro
    fitted = _fit_robustly(np.column_stack([stretches.turn, rise, stretches.seconds]), turned)
    if fitted is None:
        return None
    scale = robot.model.imu.gyro_scale.value
    found = Factor(
        float(fitted[0][0]) / scale, math.hypot(math.sqrt(float(fitted[1][0, 0])), MIN_STD * scale) / scale
    )
    return found if found.value > 0.0 and found.std < MAX_STD * found.value else None


def _mean_factor(fitted: tuple[Array, Array]) -> Factor:
    """Mean of both wheels' factors, with its relative standard deviation."""
    values, covariance = fitted
    mean = 0.5 * float(values[:2].sum())
    return Factor(mean, 0.5 * math.sqrt(float(covariance[:2, :2].sum())) / abs(mean or 1.0))


def _wheel_factor(by_turn: tuple[Array, Array], index: int, track: Factor) -> Factor:
    """One wheel's factor, from its contribution to turns: only these determine it if the marker is not at the
    robot's middle."""
    values, covariance = by_turn
    value, std = float(values[index]), math.sqrt(float(covariance[index, index]))
    return Factor(value * track.value, math.hypot(std * track.value, value * track.std))


def _wheel_ratio(by_turn: tuple[Array, Array]) -> Factor:
    (left, right), covariance = by_turn[0][:2], by_turn[1][:2, :2]
    slope = np.array([-right / left**2, 1.0 / left])
    return Factor(float(right / left), math.hypot(math.sqrt(float(slope @ covariance @ slope)), MIN_STD))


def _fit_robustly(J: Array, y: Array) -> tuple[Array, Array] | None:
    """Coefficients by robust least squares (iteratively reweighted), in which outlying stretches do not
    count, and their covariance; None if too few stretches move."""
    moving = np.abs(J[:, :-1]).sum(axis=1) > 1e-6
    if moving.sum() < max(MIN_SAMPLES // 5, 2 * J.shape[1]) or np.linalg.matrix_rank(J) < J.shape[1]:
        return None
    J, y = J[moving], y[moving]
    freedom = len(y) - J.shape[1]
    weights, scale = np.ones(len(y)), 0.0
    for iteration in range(REWEIGHTINGS):
        root = np.sqrt(weights)
        numbers = np.linalg.lstsq(J * root[:, None], y * root, rcond=None)[0]
        residuals = y - J @ numbers
        # Huber's weights come first: from a start shifted by outliers, Tukey's may reject good stretches.
        # Then the scale is fixed: updated with Tukey's weights it would reject ever more of few stretches.
        if iteration < REWEIGHTINGS // 2:
            scale = (
                MAD_TO_STD * (1.0 + SMALL_SAMPLE_CORRECTION / freedom) * float(np.median(np.abs(residuals)))
            )
            weights = 1.0 / np.maximum(np.abs(residuals) / max(scale, 1e-7), 1.0)
        else:
            squares = (residuals / max(TUKEY_CONSTANT * scale, 1e-7)) ** 2
            weights = np.clip(1.0 - squares, 0.0, None) ** 2
    inside = squares < 1.0
    slope = float(np.where(inside, (1.0 - squares) * (1.0 - 5.0 * squares), 0.0).mean())
    curvature = J[inside].T @ J[inside]
    if slope < MIN_INFLUENCE_SLOPE or np.linalg.cond(curvature) > 1e14:
        return None
    variance = float(((weights * residuals) ** 2).sum()) / freedom / slope**2
    return np.asarray(numbers, float), np.asarray(variance * np.linalg.inv(curvature), float)
