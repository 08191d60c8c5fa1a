"""What a reference of the pose says of gyro and wheels, and whether it has the units and signs of the format.

Turn and way of the reference are compared with those of gyro and wheels over short stretches, not along the
whole path: a robot that is held by a wall for half a second spoils that half second, not all that follows.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError, TraceError
from raccoon.core.readings import Device
from raccoon.estimate.drive_calibration.columns import manoeuvre

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

STRETCH = 0.5
"""S of a stretch."""
FEWEST = 50
"""Samples of a reference, and a tenth of them stretches in which something moves."""
LEAST_TURN, LEAST_WAY = math.pi, 0.3
UNSURE = 0.02
"""Deviation of a factor from which it is not determined."""
LEAST = 0.001
"""Deviation below which none is believed: filters and lags differ between turns by as much."""
SPEED_OVER = 0.02
"""S to either side over which a wheel's speed is taken: single ticks say little."""
BISQUARE, NORMAL, SMALL, ROUNDS = 4.685, 1.4826, 5.0, 40
"""Tukey's constant, at which next to nothing is lost where all stretches are good; what makes a standard
deviation of a median, and by how much more where there are few (Rousseeuw and Leroy 1987); refits."""
LEAST_SLOPE = 0.2
"""Mean slope of Tukey's influence (1 without outliers) below which too much was left out to be believed."""
DEGREES = 180.0 / math.pi
LENGTHS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37}
OTHER_UNIT = 15.0
"""Factor beyond which no robot.toml is as wrong as that: it is a unit."""
SAME, LIKE = 2.5, 0.8
"""Factor within which two sensors agree on what they both see; correlation from which they see the same."""
MOST_ASKEW = 0.35
"""Rad between where a reference moves and where it says that the robot points; less is how a marker sits."""


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


@dataclass(frozen=True, slots=True)
class _Stretches:
    """Each array (stretches,) or (stretches, 2) for both wheels. seconds; turn and, where there is a place,
    way of the reference; turn of the gyro and by how much its rate rose; way of the wheels in m and by how
    much their speeds rose."""

    seconds: Array
    turn: Array
    way: Array | None
    gyro: tuple[Array, Array] | None
    wheels: tuple[Array, Array] | None


def reference_of(columns: Columns, robot: RobotConfig, device: Device) -> Reference:
    """What the `truth.*` of a recording says.

    Raises TraceError naming the column where it is in another unit or mirrored.
    """
    check_reference(columns, robot, device)
    seen = _stretches(columns, robot, device)
    if seen is None:
        return Reference()
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
    wide = Factor(length.value / turn.value, math.hypot(length.std, turn.std, LEAST))
    if not (turn.value > 0.0 and length.value > 0.0 and wide.std < UNSURE):
        return found
    wide = replace(wide, std=wide.std * wide.value)
    sides = [_side(by_turn, index, wide) for index in (0, 1)]
    return replace(found, track=wide, left=sides[0], right=sides[1], uneven=_uneven(by_turn))


def _gyro_factor(seen: _Stretches, robot: RobotConfig) -> Factor | None:
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


def _stretches(columns: Columns, robot: RobotConfig, device: Device) -> _Stretches | None:
    heading = columns.get("truth.heading")
    if heading is None or np.isfinite(heading).sum() < FEWEST:
        return None
    time = np.asarray(columns["t"], float)
    known = time[np.isfinite(heading)]
    ends = np.searchsorted(time, np.arange(known[0], known[-1], STRETCH))
    if len(ends) < FEWEST // 5:
        return None
    truth = _heading(time, heading, 2.0 * math.pi)
    gyro = _gyro_turns(columns, time, ends)
    wheels = _wheel_ways(columns, robot, device, time, ends)
    way = _way(columns, time, truth, ends, wheels)
    return _Stretches(np.diff(time[ends]), np.diff(truth[ends]), way, gyro, wheels)


def _heading(time: Array, heading: Array, period: float) -> Array:
    known = np.isfinite(heading)
    return np.interp(time, time[known], np.unwrap(heading[known], period=period))


def _gyro_turns(columns: Columns, time: Array, ends: NDArray[np.intp]) -> tuple[Array, Array] | None:
    rate = columns.get("imu.gyro.z")
    if rate is None or np.isfinite(rate).sum() < FEWEST:
        return None
    known = np.isfinite(rate)
    rates = np.interp(time, time[known], rate[known])
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(time))])
    return np.diff(turned[ends]), np.diff(_speed(time, turned)[ends])


def _wheel_ways(
    columns: Columns, robot: RobotConfig, device: Device, time: Array, ends: NDArray[np.intp]
) -> tuple[Array, Array] | None:
    """Where back-EMF is recorded, at robot.toml's K_E as the simulation has it, whatever a tick was
    calibrated to be worth."""
    motors = {
        port: replace(each, radians_per_tick=None) if f"motor.{port}.bemf" in columns else each
        for port, each in robot.motors.items()
    }
    try:
        driven = manoeuvre(columns, replace(robot, motors=motors), device=device)
    except CalibrationError:
        return None
    ways = [robot.model.drive.wheel_radius.value * each for each in (driven.left, driven.right)]
    speeds = [_speed(time, each) for each in ways]
    both = [np.diff(np.column_stack(each)[ends], axis=0) for each in (ways, speeds)]
    return both[0], both[1]


def _speed(time: Array, along: Array) -> Array:
    """Rate of change over a few samples; what a sensor that is late has seen less is its rise times that."""
    ahead, behind = (np.interp(time + each, time, along) for each in (SPEED_OVER, -SPEED_OVER))
    return np.asarray((ahead - behind) / (2.0 * SPEED_OVER), float)


def _place(columns: Columns, time: Array) -> NDArray[np.complex128] | None:
    x, y = columns.get("truth.x"), columns.get("truth.y")
    if x is None or y is None:
        return None
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < FEWEST:
        return None
    both = [np.interp(time, time[known], np.asarray(each, float)[known]) for each in (x, y)]
    return np.asarray(both[0] + 1j * both[1], complex)


def _way(
    columns: Columns, time: Array, heading: Array, ends: NDArray[np.intp], wheels: tuple[Array, Array] | None
) -> Array | None:
    """M along the heading, turned by how the reference's marker sits."""
    place = _place(columns, time)
    if place is None:
        return None
    middle = np.exp(-0.5j * (heading[1:] + heading[:-1]))
    along = np.concatenate([[0.0], np.cumsum(np.diff(place) * middle)])
    steps = np.diff(along[ends])
    if wheels is not None:
        askew = cmath.phase(complex(wheels[0].mean(axis=1) @ steps))
        steps = steps * cmath.exp(-1j * askew) if abs(askew) < MOST_ASKEW else steps
    return np.asarray(steps.real, float)


def check_reference(columns: Columns, robot: RobotConfig, device: Device) -> None:
    """Raise TraceError where `truth.*` is in another unit than the format's, or mirrored."""
    seen = _stretches(columns, robot, device)
    if seen is None:
        return
    time, heading = np.asarray(columns["t"], float), columns["truth.heading"]
    known = time[np.isfinite(heading)]
    ends = np.searchsorted(time, np.arange(known[0], known[-1], STRETCH))
    others = {} if seen.gyro is None else {"imu.gyro.z": seen.gyro[0]}
    if seen.wheels is not None:
        left, right = seen.wheels[0].T
        others["the wheels"] = (right - left) / robot.model.drive.track_width.value
    others = {
        name: each
        for name, each in others.items()
        if float(np.abs(each).sum()) > LEAST_TURN / 2.0 and np.ptp(each) > 1e-3
    }
    if not others or np.ptp(seen.turn) == 0.0:
        return
    in_degrees = np.diff(_heading(time, heading, 360.0)[ends])
    _check_turns(in_degrees, others, (DEGREES / SAME, DEGREES * SAME))
    _check_turns(seen.turn, others, (0.0, math.inf))
    if "the wheels" in others and seen.wheels is not None:
        turns = _agreement(seen.turn, {"the wheels": others["the wheels"]})
        if turns is not None and 1.0 / (2.0 * SAME) < turns < 2.0 * SAME:
            _check_place(columns, robot, device)


def _agreement(turn: Array, others: Mapping[str, Array]) -> float | None:
    """By how much the reference turns more than the others do; None where they do not agree on that."""
    factors = []
    for each in others.values():
        if abs(float(np.corrcoef(each, turn)[0, 1])) < LIKE:
            return None
        factors.append(float(each @ turn / (each @ each)))
    low, high = min(factors, key=abs), max(factors, key=abs)
    return factors[0] if low * high > 0.0 and high / low < SAME else None


def _check_turns(turn: Array, others: Mapping[str, Array], between: tuple[float, float]) -> None:
    factor = _agreement(turn, others)
    if factor is None or not between[0] < abs(factor) < between[1]:
        return
    names = " and ".join(others)
    if DEGREES / SAME < abs(factor) < DEGREES * SAME:
        raise TraceError(
            f"truth.heading turns {abs(factor):.3g} times as much as {names}: it looks like degrees, not "
            "radians"
        )
    if factor < 0.0:
        raise TraceError(
            f"truth.heading turns against {names} ({factor:.3g} times as much): it is mirrored. It counts "
            "counter-clockwise, seen from above"
        )
    if len(others) > 1 and not 1.0 / OTHER_UNIT < factor < OTHER_UNIT:
        raise TraceError(
            f"truth.heading turns {factor:.3g} times as much as {names}: it is in another unit than radians"
        )


def _check_place(columns: Columns, robot: RobotConfig, device: Device) -> None:
    """Whether the place moves where the heading points, and as far as the wheels say."""
    time = np.asarray(columns["t"], float)
    place = _place(columns, time)
    if place is None:
        return
    heading = _heading(time, columns["truth.heading"], 2.0 * math.pi)
    known = np.isfinite(columns["truth.x"]) & np.isfinite(columns["truth.heading"])
    ends = np.searchsorted(time, np.arange(time[known][0], time[known][-1], 0.2 * STRETCH))
    wheels = _wheel_ways(columns, robot, device, time, ends)
    if wheels is None or len(ends) < FEWEST:
        return
    way, moved = wheels[0].mean(axis=1), np.diff(place[ends])
    middle = 0.5 * (heading[ends][1:] + heading[ends][:-1])
    size = math.sqrt(float(way @ way) * float((np.abs(moved) ** 2).sum()))
    if float(np.abs(way).sum()) < LEAST_WAY or size == 0.0:
        return
    expected = way * np.exp(-1j * middle)
    along, mirrored = complex(expected @ moved), complex(expected @ moved.conj())
    if abs(mirrored) > LIKE * size and abs(along) < 0.5 * abs(mirrored):
        raise TraceError(
            "truth.x or truth.y is mirrored: they move where truth.heading points only with the sign of one "
            "of them changed. x and y are to each other as forward is to left"
        )
    if abs(along) < LIKE * size:
        return
    askew = cmath.phase(along)
    if abs(askew) > MOST_ASKEW:
        raise TraceError(
            f"truth.x and truth.y move at {math.degrees(askew):.0f} degrees to truth.heading: it is 0 where "
            "the robot points along x"
        )
    factor = abs(along) / float(way @ way)
    if not 1.0 / OTHER_UNIT < factor < OTHER_UNIT:
        near = min(LENGTHS, key=lambda each: abs(math.log(LENGTHS[each] / factor)))
        unit = near if abs(math.log(LENGTHS[near] / factor)) < math.log(1.5) else "another unit"
        raise TraceError(
            f"truth.x and truth.y move {factor:.3g} times as far as the wheels: it looks like {unit}, not "
            "metres"
        )
