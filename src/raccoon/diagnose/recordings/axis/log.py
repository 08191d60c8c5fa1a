"""The recording of one motor or axis on an even grid: its effort and its motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.holdout import check_none_missing
from raccoon.trace.recording import time_unit_hint

Array = NDArray[np.float64]

MIN_SAMPLES = 100
"""Least number of values in a column that is used."""
EFFORT_UNITS = {"force": "N", "torque": "N m", "voltage": "V"}
"""Efforts that may drive an axis, with units; the first one in the recording is used."""
MOTION_UNITS = {"travel": "m", "angle": "rad", "speed": "rad/s"}
"""Measured motions, with units; `travel` goes with a force, the others with a torque or a voltage."""


@dataclass(frozen=True, slots=True)
class AxisLog:
    """One axis on a uniform time grid with a step of `step` s.

    effort (n,): input in `effort_unit`, each value valid until the next. motion (n,): a position, or a speed
    if `is_speed`; NaN without a reading. current (n,): A, or None. holdout_row: first row of the held-out
    part. names: columns of effort, motion and current. full_effort: effort of a full command: the recorded
    battery voltage, else the largest effort.
    """

    time: Array
    step: float
    effort: Array
    effort_unit: str
    motion: Array
    motion_unit: str
    current: Array | None
    names: tuple[str, str, str]
    holdout_row: int
    full_effort: float

    @property
    def is_speed(self) -> bool:
        """Whether `motion` is a speed."""
        return self.motion_unit.endswith("/s")

    @property
    def speed_unit(self) -> str:
        """Unit of the speed."""
        return self.motion_unit if self.is_speed else f"{self.motion_unit}/s"

    @property
    def is_electrical(self) -> bool:
        """Whether a voltage drives the axis and the measured current separates winding and mechanics."""
        return self.effort_unit == "V" and self.current is not None

    @property
    def torque_unit(self) -> str:
        """Unit of the force or torque; V if a voltage drives the axis and no current gives its torque."""
        return "N m" if self.is_electrical else self.effort_unit


def axis_log(columns: Mapping[str, Array], port: int) -> AxisLog:
    """The log of motor `port` from the columns of a recording.

    Raises TraceError if effort or motion is missing, the effort never changes, or the time is too uneven.
    """
    time = _even_time(columns["t"])
    effort_name, effort_unit = _find_column(columns, port, EFFORT_UNITS)
    motion_name, motion_unit = _find_column(columns, port, MOTION_UNITS)
    effort = _sample_and_hold(columns[effort_name], columns["t"], time)
    motion = _resample(columns[motion_name], columns["t"], time)
    if float(np.ptp(effort)) == 0.0:
        raise TraceError(
            f"{effort_name} is {float(effort[0]):g} {effort_unit} all the time: one steady state cannot tell "
            "inertia from friction; record steps"
        )
    current_name = f"motor.{port}.current"
    current = columns.get(current_name)
    known = current is not None and np.isfinite(current).sum() > MIN_SAMPLES
    return AxisLog(
        time,
        float(time[1] - time[0]),
        effort,
        effort_unit,
        motion,
        motion_unit,
        _resample(current, columns["t"], time) if known and current is not None else None,
        (effort_name, motion_name, current_name),
        holdout_start(effort),
        _full_effort(columns, effort, effort_unit),
    )


def with_channels_of(fitted: AxisLog, other: AxisLog) -> AxisLog:
    """Another log of the same axis with the channels of the fitted one. Raises TraceError that names missing
    ones."""
    check_none_missing(
        [ours for ours, theirs in zip(fitted.names[:2], other.names[:2], strict=True) if ours != theirs]
    )
    if other.full_effort <= float(
        np.abs(other.effort).max()
    ):  # it is the largest effort, which may not be a full command
        other = replace(other, full_effort=fitted.full_effort)
    if fitted.current is None:
        return replace(other, current=None)
    check_none_missing([fitted.names[2]] if other.current is None else [])
    return other


def _full_effort(columns: Mapping[str, Array], effort: Array, unit: str) -> float:
    largest = float(np.abs(effort).max())
    battery = columns.get("battery.voltage")
    if unit != "V" or battery is None or not np.isfinite(battery).any():
        return largest
    return max(float(np.nanmedian(battery)), largest)


def _find_column(columns: Mapping[str, Array], port: int, kinds: Mapping[str, str]) -> tuple[str, str]:
    for kind, unit in kinds.items():
        name = f"motor.{port}.{kind}"
        if name in columns and np.isfinite(columns[name]).sum() >= MIN_SAMPLES:
            return name, unit
    names = ", ".join(f"motor.{port}.{kind}" for kind in kinds)
    raise TraceError(f"one of {names} with at least {MIN_SAMPLES} numbers is needed")


def _even_time(recorded: Array) -> Array:
    if len(recorded) < MIN_SAMPLES:
        raise TraceError(f"the recording has {len(recorded)} samples: at least {MIN_SAMPLES} are needed")
    steps = np.diff(recorded)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 1
        raise TraceError(f"t does not advance at row {row}: {recorded[row - 1]:.6g} to {recorded[row]:.6g} s")
    step = float(np.median(steps))
    if problem := time_unit_hint(step):
        raise TraceError(problem)
    if float(steps.max()) > max(0.1, 20.0 * step):
        raise TraceError(f"t has a gap of {float(steps.max()):.3g} s: the motion in it is not known")
    return np.linspace(recorded[0], recorded[-1], round(float(np.ptp(recorded)) / step) + 1)


def _sample_and_hold(values: Array, recorded: Array, time: Array) -> Array:
    """Values at each time by sample and hold."""
    known = np.isfinite(values)
    rows = np.searchsorted(recorded[known], time + 1e-9, side="right") - 1
    return np.asarray(values[known][np.maximum(rows, 0)], float)


def _resample(values: Array, recorded: Array, time: Array) -> Array:
    """Values interpolated linearly at each time, NaN if the nearest sample is NaN."""
    known = np.isfinite(values)
    if len(time) == len(recorded) and np.abs(time - recorded).max() < 0.1 * (time[1] - time[0]):
        return np.where(known, values, np.nan)
    found = np.interp(time, recorded[known], values[known])
    is_missing = np.interp(time, recorded, (~known).astype(float)) > 0.5
    return np.where(is_missing, np.nan, found)


def holdout_start(effort: Array) -> int:
    """First row of the held-out later part: at a step of the effort around the middle, else at 70 %."""
    count = len(effort)
    changes = np.flatnonzero(np.diff(effort) != 0.0) + 1
    inner = changes[(changes > 0.45 * count) & (changes < 0.75 * count)]
    if len(changes) <= 20 and len(inner):
        return int(inner[0])
    return int(0.7 * count)
