"""Checks of a reference's units and signs by gyro and wheels."""

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
    MAX_MISALIGNMENT,
    MIN_DISTANCE,
    MIN_SAMPLES,
    MIN_TURN,
    STRETCH_S,
    Columns,
    PoseStretches,
    cut_stretches,
    heading_at,
    position_at,
    stretch_starts,
    wheel_distances,
)

Array = NDArray[np.float64]

DEGREES = 180.0 / math.pi
LENGTH_UNITS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37}
MIN_UNIT_FACTOR = 15.0
"""Factor beyond which the unit is wrong, since no robot.toml is off by as much."""
MAX_SENSOR_RATIO, MIN_CORRELATION = 2.5, 0.8
"""Largest ratio of two sensors that agree, and least correlation of sensors that see the same motion."""
SENSOR_EXPLANATIONS = {
    "imu.gyro.z": "the gyro's axis points down",
    "the wheels": "left and right are swapped",
}
"""Alternative explanations for a single sensor that turns opposite to a reference."""
MAX_MIRROR_RATIO = 0.85
"""Ratio of the motion explained with right and with mirrored signs below which a reference is clearly
mirrored; along a single line both explain the same."""


def check_reference(columns: Columns, robot: RobotConfig, device: Device) -> None:
    """Raise TraceError if `truth.*` is in another unit than the format's, or mirrored."""
    stretches = cut_stretches(columns, robot, device)
    if stretches is not None:
        check_stretches(stretches, columns, robot, device)


def check_stretches(stretches: PoseStretches, columns: Columns, robot: RobotConfig, device: Device) -> None:
    """`check_reference` for stretches that were already cut."""
    others = {} if stretches.gyro is None else {"imu.gyro.z": stretches.gyro[0]}
    if stretches.wheels is not None:
        left, right = stretches.wheels[0].T
        others["the wheels"] = (right - left) / robot.model.drive.track_width.value
    others = {
        name: each
        for name, each in others.items()
        if float(np.abs(each).sum()) > MIN_TURN / 2.0 and np.ptp(each) > 1e-3
    }
    if not others or np.ptp(stretches.turn) == 0.0:
        return
    in_degrees = np.diff(heading_at(stretches.time, columns["truth.heading"], 360.0)[stretches.ends])
    _check_turns(in_degrees, others, (DEGREES / MAX_SENSOR_RATIO, DEGREES * MAX_SENSOR_RATIO))
    _check_turns(stretches.turn, others, (0.0, math.inf))
    if "the wheels" in others and stretches.wheels is not None:
        turns = _turn_ratio(stretches.turn, {"the wheels": others["the wheels"]})
        if turns is not None and 1.0 / (2.0 * MAX_SENSOR_RATIO) < turns < 2.0 * MAX_SENSOR_RATIO:
            _check_position(columns, robot, device)


def unrelated_reference_note(columns: Columns, robot: RobotConfig, device: Device) -> str:
    """A note if the reference correlates with neither gyro nor wheels although these turn and drive; ""
    otherwise."""
    stretches = cut_stretches(columns, robot, device)
    if stretches is None or stretches.wheels is None:
        return ""
    left, right = stretches.wheels[0].T
    turned = (right - left) / robot.model.drive.track_width.value
    others = [turned] if stretches.gyro is None else [turned, stretches.gyro[0]]
    turns = [each for each in others if float(np.abs(each).sum()) > MIN_TURN and np.ptp(each) > 1e-3]
    problem = ""
    if (
        len(turns) == len(others)
        and max(_abs_correlation(each, stretches.turn) for each in turns) < MIN_CORRELATION
    ):
        problem = "truth.heading does not turn as the wheels" + (
            " do" if len(others) == 1 else " and the gyro do"
        )
    else:
        motion = _position_motion(columns, robot, device)
        if motion is not None and abs(motion.along) < MIN_CORRELATION * motion.size:
            problem = "truth.x and truth.y do not move where truth.heading points as the wheels do"
    return (
        f"{problem}: is the reference of another drive, of another time or of something else?"
        if problem
        else ""
    )


def _abs_correlation(one: Array, other: Array) -> float:
    return abs(float(np.corrcoef(one, other)[0, 1])) if np.ptp(other) > 0.0 else 0.0


def _turn_ratio(turn: Array, others: Mapping[str, Array]) -> float | None:
    """Ratio of the reference's turn to the sensors'; None if the sensors disagree on it."""
    factors = []
    for each in others.values():
        if abs(float(np.corrcoef(each, turn)[0, 1])) < MIN_CORRELATION:
            return None
        factors.append(float(each @ turn / (each @ each)))
    low, high = min(factors, key=abs), max(factors, key=abs)
    return factors[0] if low * high > 0.0 and high / low < MAX_SENSOR_RATIO else None


def _check_turns(turn: Array, others: Mapping[str, Array], allowed: tuple[float, float]) -> None:
    factor = _turn_ratio(turn, others)
    if factor is None or not allowed[0] < abs(factor) < allowed[1]:
        return
    names = " and ".join(others)
    if DEGREES / MAX_SENSOR_RATIO < abs(factor) < DEGREES * MAX_SENSOR_RATIO:
        raise TraceError(
            f"truth.heading turns {abs(factor):.3g} times as much as {names}: it looks like degrees, not "
            "radians"
        )
    if factor < 0.0:
        otherwise = "" if len(others) > 1 else f", or {SENSOR_EXPLANATIONS[names]}"
        raise TraceError(
            f"truth.heading turns against {names} ({factor:.3g} times as much): it is mirrored{otherwise}. "
            "It must count counter-clockwise, seen from above"
        )
    if len(others) > 1 and not 1.0 / MIN_UNIT_FACTOR < factor < MIN_UNIT_FACTOR:
        raise TraceError(
            f"truth.heading turns {factor:.3g} times as much as {names}: it is in another unit than radians"
        )


@dataclass(frozen=True, slots=True)
class _PositionMotion:
    """Motion of a position along its heading. along: sum over stretches of the wheels' distance times the
    motion in the heading's frame, complex. mirrored: the same with the sign of y reversed. size: upper bound
    of both. way: sum of the wheels' squared distances."""

    along: complex
    mirrored: complex
    size: float
    way: float


def _position_motion(columns: Columns, robot: RobotConfig, device: Device) -> _PositionMotion | None:
    """The motion of the reference's position; None if too little is known or nothing moves."""
    time = np.asarray(columns["t"], float)
    place = position_at(columns, time)
    if place is None:
        return None
    heading = heading_at(time, columns["truth.heading"], 2.0 * math.pi)
    # Position and heading may be known in different rows, as from two cameras.
    known = [time[np.isfinite(columns[f"truth.{each}"])] for each in ("x", "y", "heading")]
    ends = stretch_starts(
        time, max(each[0] for each in known), min(each[-1] for each in known), 0.2 * STRETCH_S
    )
    wheels = wheel_distances(columns, robot, device, time, ends)
    if wheels is None or len(ends) < MIN_SAMPLES:
        return None
    wheel_way, moved = wheels[0].mean(axis=1), np.diff(place[ends])
    middle = 0.5 * (heading[ends][1:] + heading[ends][:-1])
    size = math.sqrt(float(wheel_way @ wheel_way) * float((np.abs(moved) ** 2).sum()))
    if float(np.abs(wheel_way).sum()) < MIN_DISTANCE or size == 0.0:
        return None
    expected = wheel_way * np.exp(-1j * middle)
    return _PositionMotion(
        complex(expected @ moved), complex(expected @ moved.conj()), size, float(wheel_way @ wheel_way)
    )


def _check_position(columns: Columns, robot: RobotConfig, device: Device) -> None:
    """Raise TraceError if the position does not move along the heading, or not as far as the wheels."""
    motion = _position_motion(columns, robot, device)
    if motion is None:
        return
    along, mirrored, size = motion.along, motion.mirrored, motion.size
    if abs(mirrored) > MIN_CORRELATION * size and abs(along) < MAX_MIRROR_RATIO * abs(mirrored):
        raise TraceError(
            "truth.x or truth.y is mirrored: they follow truth.heading only if the sign of one of them is "
            "changed. If x points forward, y must point left"
        )
    if abs(along) < MIN_CORRELATION * size:
        return
    askew = cmath.phase(along)
    if abs(askew) > MAX_MISALIGNMENT:
        raise TraceError(
            f"truth.x and truth.y move at {math.degrees(askew):.0f} degrees to truth.heading: it must be 0 "
            "where the robot points along x"
        )
    factor = abs(along) / motion.way
    if not 1.0 / MIN_UNIT_FACTOR < factor < MIN_UNIT_FACTOR:
        near = min(LENGTH_UNITS, key=lambda each: abs(math.log(LENGTH_UNITS[each] / factor)))
        unit = near if abs(math.log(LENGTH_UNITS[near] / factor)) < math.log(1.5) else "another unit"
        raise TraceError(
            f"truth.x and truth.y move {factor:.3g} times as far as the wheels: it looks like {unit}, not "
            "metres"
        )
