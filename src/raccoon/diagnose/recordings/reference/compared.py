"""What a reference of the pose says of gyro and wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device
from raccoon.diagnose.recordings.reference.stretches import (
    FEWEST,
    LEAST_TURN,
    LEAST_WAY,
    Columns,
    Stretches,
    stretches_of,
)
from raccoon.diagnose.recordings.reference.units import check_stretches

Array = NDArray[np.float64]

UNSURE = 0.02
"""Deviation of a factor from which it is not determined."""
LEAST = 0.001
"""Deviation below which none is believed: filters and lags differ between turns by as much."""
BISQUARE, NORMAL, SMALL, ROUNDS = 4.685, 1.4826, 5.0, 40
"""Tukey's constant, at which next to nothing is lost where all stretches are good; what makes a standard
deviation of a median, and by how much more where there are few (Rousseeuw and Leroy 1987); refits."""
LEAST_SLOPE = 0.2
"""Mean slope of Tukey's influence (1 without outliers) below which too much was left out to be believed."""


@dataclass(frozen=True, slots=True)
class Factor:
    """A number over the assumed one."""

    value: float
    std: float


@dataclass(frozen=True, slots=True)
class Reference:
    """What a reference says, None where it does not.

    gyro: the gyro's reading over the turn rate. track: the track width over robot.toml's. left, right: the
    way of a wheel over what its reading says at robot.toml's radius and K_E. uneven: the right one's over the
    left one's, which is known better than either.
    """

    gyro: Factor | None = None
    track: Factor | None = None
    left: Factor | None = None
    right: Factor | None = None
    uneven: Factor | None = None


def reference_of(columns: Columns, robot: RobotConfig, device: Device) -> Reference:
    """What the `truth.*` of a recording says.

    Raises TraceError naming the column where it is in another unit or mirrored.
    """
    seen = stretches_of(columns, robot, device)
    if seen is None:
        return Reference()
    check_stretches(seen, columns, robot, device)
    found = Reference(gyro=_gyro_factor(seen, robot))
    if seen.way is None or seen.wheels is None or float(np.abs(seen.way).sum()) < LEAST_WAY:
        return found
    way, rose = seen.wheels
    dt, track = seen.seconds[:, None], robot.model.drive.track_width.value
    by_way = _fitted(np.hstack([way, rose, dt]) / 2.0, seen.way)
    by_turn = _fitted(np.hstack([way, rose, dt]) * [-1.0, 1.0, -1.0, 1.0, 1.0] / track, seen.turn)
    if by_way is None or by_turn is None:
        return found
    length, turn = _both(by_way), _both(by_turn)
    if not (turn.value > 0.0 and length.value > 0.0):  # as where it never turned at all
        return found
    wide = Factor(length.value / turn.value, math.hypot(length.std, turn.std, LEAST))
    if not wide.std < UNSURE:
        return found
    wide = replace(wide, std=wide.std * wide.value)
    sides = [_side(by_turn, index, wide) for index in (0, 1)]
    return replace(found, track=wide, left=sides[0], right=sides[1], uneven=_uneven(by_turn))


def _gyro_factor(seen: Stretches, robot: RobotConfig) -> Factor | None:
    if seen.gyro is None or float(np.abs(seen.turn).sum()) < LEAST_TURN:
        return None
    turned, rose = seen.gyro
    fitted = _fitted(np.column_stack([seen.turn, rose, seen.seconds]), turned)
    if fitted is None:
        return None
    scale = robot.model.imu.gyro_scale.value
    found = Factor(
        float(fitted[0][0]) / scale, math.hypot(math.sqrt(float(fitted[1][0, 0])), LEAST * scale) / scale
    )
    return found if found.value > 0.0 and found.std < UNSURE * found.value else None


def _both(fitted: tuple[Array, Array]) -> Factor:
    """Mean of both wheels' factors, with its relative deviation."""
    values, covariance = fitted
    mean = 0.5 * float(values[:2].sum())
    return Factor(mean, 0.5 * math.sqrt(float(covariance[:2, :2].sum())) / abs(mean or 1.0))


def _side(by_turn: tuple[Array, Array], index: int, track: Factor) -> Factor:
    """One wheel's way, from its share in turns: where a marker sits beside the middle, only these tell."""
    values, covariance = by_turn
    value, std = float(values[index]), math.sqrt(float(covariance[index, index]))
    return Factor(value * track.value, math.hypot(std * track.value, value * track.std))


def _uneven(by_turn: tuple[Array, Array]) -> Factor:
    (left, right), covariance = by_turn[0][:2], by_turn[1][:2, :2]
    slope = np.array([-right / left**2, 1.0 / left])
    return Factor(float(right / left), math.hypot(math.sqrt(float(slope @ covariance @ slope)), LEAST))


def _fitted(J: Array, y: Array) -> tuple[Array, Array] | None:
    """Least squares in which stretches that no factor explains do not count, and its covariance; None where
    too few move."""
    moving = np.abs(J[:, :-1]).sum(axis=1) > 1e-6
    if moving.sum() < max(FEWEST // 5, 2 * J.shape[1]) or np.linalg.matrix_rank(J) < J.shape[1]:
        return None
    J, y = J[moving], y[moving]
    more = len(y) - J.shape[1]
    weights, scale = np.ones(len(y)), 0.0
    for turn in range(ROUNDS):
        root = np.sqrt(weights)
        found = np.linalg.lstsq(J * root[:, None], y * root, rcond=None)[0]
        left = y - J @ found
        # Huber's weights first: from a start that outliers have pulled away, Tukey's may drop what is right.
        # And a size that Tukey's could still lower would drop more and more of few stretches.
        if turn < ROUNDS // 2:
            scale = NORMAL * (1.0 + SMALL / more) * float(np.median(np.abs(left)))
            weights = 1.0 / np.maximum(np.abs(left) / max(scale, 1e-7), 1.0)
        else:
            square = (left / max(BISQUARE * scale, 1e-7)) ** 2
            weights = np.clip(1.0 - square, 0.0, None) ** 2
    inside = square < 1.0
    slope = float(np.where(inside, (1.0 - square) * (1.0 - 5.0 * square), 0.0).mean())
    curvature = J[inside].T @ J[inside]
    if slope < LEAST_SLOPE or np.linalg.cond(curvature) > 1e14:
        return None
    variance = float(((weights * left) ** 2).sum()) / more / slope**2
    return np.asarray(found, float), np.asarray(variance * np.linalg.inv(curvature), float)
