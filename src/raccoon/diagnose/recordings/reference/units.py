"""Whether a reference of the pose has the units and the signs of the format, by what gyro and wheels say."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.readings import Device
from raccoon.diagnose.recordings.reference.stretches import (
    FEWEST,
    LEAST_TURN,
    LEAST_WAY,
    MOST_ASKEW,
    STRETCH,
    Columns,
    Stretches,
    ends_of,
    heading_at,
    place_at,
    stretches_of,
    wheel_ways,
)

Array = NDArray[np.float64]

DEGREES = 180.0 / math.pi
LENGTHS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37}
OTHER_UNIT = 15.0
"""Factor beyond which no robot.toml is as wrong as that: it is a unit."""
SAME, LIKE = 2.5, 0.8
"""Factor within which two sensors agree on what they both see; correlation from which they see the same."""
ALONE = {"imu.gyro.z": "the gyro's axis points down", "the wheels": "left and right are swapped"}
"""What else it may be where one sensor alone turns against a reference."""
CLEARLY = 0.85
"""Part of what one way of counting explains that the other may, where it is clearly the first: along one line
both explain the same."""


def check_reference(columns: Columns, robot: RobotConfig, device: Device) -> None:
    """Raise TraceError where `truth.*` is in another unit than the format's, or mirrored."""
    seen = stretches_of(columns, robot, device)
    if seen is not None:
        check_stretches(seen, columns, robot, device)


def check_stretches(seen: Stretches, columns: Columns, robot: RobotConfig, device: Device) -> None:
    """`check_reference` of stretches that were taken already."""
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
    in_degrees = np.diff(heading_at(seen.time, columns["truth.heading"], 360.0)[seen.ends])
    _check_turns(in_degrees, others, (DEGREES / SAME, DEGREES * SAME))
    _check_turns(seen.turn, others, (0.0, math.inf))
    if "the wheels" in others and seen.wheels is not None:
        turns = _agreement(seen.turn, {"the wheels": others["the wheels"]})
        if turns is not None and 1.0 / (2.0 * SAME) < turns < 2.0 * SAME:
            _check_place(columns, robot, device)


def strange_reference(columns: Columns, robot: RobotConfig, device: Device) -> str:
    """That a reference is like neither the gyro nor the wheels, though these turn and drive; "" where it is,
    and where there is none."""
    seen = stretches_of(columns, robot, device)
    if seen is None or seen.wheels is None:
        return ""
    left, right = seen.wheels[0].T
    turned = (right - left) / robot.model.drive.track_width.value
    others = [turned] if seen.gyro is None else [turned, seen.gyro[0]]
    turns = [each for each in others if float(np.abs(each).sum()) > LEAST_TURN and np.ptp(each) > 1e-3]
    where = ""
    if len(turns) == len(others) and max(_alike(each, seen.turn) for each in turns) < LIKE:
        where = "truth.heading does not turn as the wheels" + (
            " do" if len(others) == 1 else " and the gyro do"
        )
    else:
        moved = _moved(columns, robot, device)
        if moved is not None and abs(moved.along) < LIKE * moved.size:
            where = "truth.x and truth.y do not move where truth.heading points as the wheels do"
    return (
        f"{where}: is the reference of another drive, of another time or of something else?" if where else ""
    )


def _alike(one: Array, other: Array) -> float:
    return abs(float(np.corrcoef(one, other)[0, 1])) if np.ptp(other) > 0.0 else 0.0


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
        alone = "" if len(others) > 1 else f", or {ALONE[names]}"
        raise TraceError(
            f"truth.heading turns against {names} ({factor:.3g} times as much): it is mirrored{alone}. It "
            "counts counter-clockwise, seen from above"
        )
    if len(others) > 1 and not 1.0 / OTHER_UNIT < factor < OTHER_UNIT:
        raise TraceError(
            f"truth.heading turns {factor:.3g} times as much as {names}: it is in another unit than radians"
        )


@dataclass(frozen=True, slots=True)
class _Moved:
    """How a place moves where the heading points: the sum over stretches of the wheels' way times what it
    moves along and across, the same with one sign changed, and what both are at most. way: the wheels' power.
    """

    along: complex
    mirrored: complex
    size: float
    way: float


def _moved(columns: Columns, robot: RobotConfig, device: Device) -> _Moved | None:
    """None where too little is known, or nothing moves."""
    time = np.asarray(columns["t"], float)
    place = place_at(columns, time)
    if place is None:
        return None
    heading = heading_at(time, columns["truth.heading"], 2.0 * math.pi)
    # A place and a heading may be of rows of their own, as from two cameras.
    known = [time[np.isfinite(columns[f"truth.{each}"])] for each in ("x", "y", "heading")]
    ends = ends_of(time, max(each[0] for each in known), min(each[-1] for each in known), 0.2 * STRETCH)
    wheels = wheel_ways(columns, robot, device, time, ends)
    if wheels is None or len(ends) < FEWEST:
        return None
    way, moved = wheels[0].mean(axis=1), np.diff(place[ends])
    middle = 0.5 * (heading[ends][1:] + heading[ends][:-1])
    size = math.sqrt(float(way @ way) * float((np.abs(moved) ** 2).sum()))
    if float(np.abs(way).sum()) < LEAST_WAY or size == 0.0:
        return None
    expected = way * np.exp(-1j * middle)
    return _Moved(complex(expected @ moved), complex(expected @ moved.conj()), size, float(way @ way))


def _check_place(columns: Columns, robot: RobotConfig, device: Device) -> None:
    """Whether the place moves where the heading points, and as far as the wheels say."""
    moved = _moved(columns, robot, device)
    if moved is None:
        return
    along, mirrored, size = moved.along, moved.mirrored, moved.size
    if abs(mirrored) > LIKE * size and abs(along) < CLEARLY * abs(mirrored):
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
    factor = abs(along) / moved.way
    if not 1.0 / OTHER_UNIT < factor < OTHER_UNIT:
        near = min(LENGTHS, key=lambda each: abs(math.log(LENGTHS[each] / factor)))
        unit = near if abs(math.log(LENGTHS[near] / factor)) < math.log(1.5) else "another unit"
        raise TraceError(
            f"truth.x and truth.y move {factor:.3g} times as far as the wheels: it looks like {unit}, not "
            "metres"
        )
