"""Turn and distance over short stretches, by a reference of the pose and by the sensors compared with it.

Stretches are compared, not the whole path: if a wall holds the robot for half a second, only that half second
is spoilt, and not everything after it.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Device
from raccoon.estimate.drive_calibration.columns import integral, manoeuvre_from_columns

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

STRETCH_S = 0.5
"""Duration of a stretch, s."""
MIN_SAMPLES = 50
"""Least number of samples of a reference; a fifth as many stretches are needed."""
MIN_TURN, MIN_DISTANCE = math.pi, 0.3
"""Least total turn, rad, and distance, m, of a recording for a comparison."""
SPEED_HALF_WINDOW_S = 0.02
"""Half-width, s, of the window over which a speed is differenced: single ticks say little."""
TICK_TOLERANCE = 0.02
"""Tolerance on the device's worth of a tick, for example for a firmware's clock."""
MAX_MISALIGNMENT = 0.35
"""Largest angle, rad, between a reference's motion and its heading that is due to the marker's mounting."""


@dataclass(frozen=True, slots=True)
class PoseStretches:
    """Motion over stretches; each array is (stretches,), or (stretches, 2) for both wheels.

    time: of all rows, s. ends: rows at which stretches begin and end. seconds: durations. turn, way: of the
    reference, rad and m; way is None without a position. gyro: turn, rad, and increase of the turn rate,
    rad/s. wheels: distances, m, and increase of the speeds, m/s.
    """

    time: Array
    ends: NDArray[np.intp]
    seconds: Array
    turn: Array
    way: Array | None
    gyro: tuple[Array, Array] | None
    wheels: tuple[Array, Array] | None


def cut_stretches(columns: Columns, robot: RobotConfig, device: Device) -> PoseStretches | None:
    """The stretches of a recording; None if its reference has too few samples."""
    heading = columns.get("truth.heading")
    if heading is None or np.isfinite(heading).sum() < MIN_SAMPLES:
        return None
    time = np.asarray(columns["t"], float)
    known = time[np.isfinite(heading)]
    ends = stretch_starts(time, known[0], known[-1], STRETCH_S)
    if len(ends) < MIN_SAMPLES // 5:
        return None
    truth = heading_at(time, heading, 2.0 * math.pi)
    gyro = _gyro_turns(columns, time, ends)
    wheels = wheel_distances(columns, robot, device, time, ends)
    way = _distance_along_heading(columns, time, truth, ends, wheels)
    return PoseStretches(time, ends, np.diff(time[ends]), np.diff(truth[ends]), way, gyro, wheels)


def heading_at(time: Array, heading: Array, period: float) -> Array:
    """The reference's heading at every row, interpolated and unwrapped. period: of a full turn, in its
    unit."""
    known = np.isfinite(heading)
    return np.interp(time, time[known], np.unwrap(heading[known], period=period))


def _gyro_turns(columns: Columns, time: Array, ends: NDArray[np.intp]) -> tuple[Array, Array] | None:
    rates = _filled_column(columns, "imu.gyro.z", time)
    if rates is None:
        return None
    angle = integral(time, rates)
    return np.diff(angle[ends]), np.diff(_rate_of_change(time, angle)[ends])


def wheel_distances(
    columns: Columns, robot: RobotConfig, device: Device, time: Array, ends: NDArray[np.intp]
) -> tuple[Array, Array] | None:
    """Distances of both wheels over stretches, m, and increase of their speeds, m/s; None if unknown.

    If back-EMF is recorded, the worth of a tick follows from robot.toml's K_E as in the simulation, whatever
    its calibration, and whatever the device says if the readings contradict it.
    """
    motors = {
        port: replace(each, radians_per_tick=None) if f"motor.{port}.bemf" in columns else each
        for port, each in robot.motors.items()
    }
    tick = _measured_tick(columns, robot, time, ends)
    if tick is not None and abs(tick / device.position_counts_seconds - 1.0) > TICK_TOLERANCE:
        device = replace(device, position_counts_seconds=tick)
    try:
        driven = manoeuvre_from_columns(columns, replace(robot, motors=motors), device=device)
    except CalibrationError:
        return None
    ways = [robot.model.drive.wheel_radius.value * each for each in (driven.left, driven.right)]
    speeds = [_rate_of_change(time, each) for each in ways]
    both = [np.diff(np.column_stack(each)[ends], axis=0) for each in (ways, speeds)]
    return both[0], both[1]


def _measured_tick(columns: Columns, robot: RobotConfig, time: Array, ends: NDArray[np.intp]) -> float | None:
    """Back-EMF per tick of the counters, counts times seconds, by the faster stretches; None without both
    readings. A CSV's counters may be those of any firmware, and one firmware's tick is 181 of another's."""
    ticks = []
    for port in (robot.drive.left, robot.drive.right):
        counts = _filled_column(columns, f"motor.{port}.bemf", time)
        position = _filled_column(columns, f"motor.{port}.position", time)
        if counts is None or position is None:
            continue
        moved, advance = np.diff(integral(time, counts)[ends]), np.diff(position[ends])
        fast = (np.abs(moved) >= np.median(np.abs(moved))) & (advance != 0.0)
        ticks.extend(moved[fast] / advance[fast])
    tick = float(np.median(ticks)) if ticks else 0.0
    return tick if tick > 0.0 else None


def _filled_column(columns: Columns, name: str, time: Array) -> Array | None:
    """A column interpolated over blanks; None if it has too few values."""
    values = columns.get(name)
    if values is None or np.isfinite(values).sum() < MIN_SAMPLES:
        return None
    known = np.isfinite(values)
    return np.interp(time, time[known], values[known])


def _rate_of_change(time: Array, along: Array) -> Array:
    """Rate of change over a few samples. A late sensor misses its delay times the increase of this rate."""
    ahead, behind = (
        np.interp(time + each, time, along) for each in (SPEED_HALF_WINDOW_S, -SPEED_HALF_WINDOW_S)
    )
    return np.asarray((ahead - behind) / (2.0 * SPEED_HALF_WINDOW_S), float)


def position_at(columns: Columns, time: Array) -> NDArray[np.complex128] | None:
    """The reference's position x + iy at every row; None without one."""
    x, y = columns.get("truth.x"), columns.get("truth.y")
    if x is None or y is None:
        return None
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < MIN_SAMPLES:
        return None
    both = [np.interp(time, time[known], np.asarray(each, float)[known]) for each in (x, y)]
    return np.asarray(both[0] + 1j * both[1], complex)


def _distance_along_heading(
    columns: Columns, time: Array, heading: Array, ends: NDArray[np.intp], wheels: tuple[Array, Array] | None
) -> Array | None:
    """Distance along the heading over stretches, m, corrected for the marker's misalignment; None without a
    position."""
    position = position_at(columns, time)
    if position is None:
        return None
    middle = np.exp(-0.5j * (heading[1:] + heading[:-1]))
    along = np.concatenate([[0.0], np.cumsum(np.diff(position) * middle)])
    steps = np.diff(along[ends])
    if wheels is not None:
        misalignment = cmath.phase(complex(wheels[0].mean(axis=1) @ steps))
        steps = steps * cmath.exp(-1j * misalignment) if abs(misalignment) < MAX_MISALIGNMENT else steps
    return np.asarray(steps.real, float)


def stretch_starts(time: Array, first: float, last: float, seconds: float) -> NDArray[np.intp]:
    """Rows of `time` at which stretches of this duration (s) begin, from `first` to before `last`."""
    begins = np.arange(first, last, seconds)
    return np.searchsorted(time, begins[begins < last])  # rounding may take arange beyond its end
