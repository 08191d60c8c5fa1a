"""A drive as the diagnosis sees it: time, what was commanded, what was measured; left before right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError

Array = NDArray[np.float64]

SHORTEST_SECONDS = 2.0
SLOWEST_STEP = 0.2
"""S between samples; a wheel settles in less."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One sensor's samples. name: the recording's column. role: what the model calls it. values: NaN where
    nothing is new. floor: the smallest noise that is believed (its quantisation)."""

    name: str
    role: str
    unit: str
    values: Array
    floor: float


@dataclass(frozen=True, slots=True)
class Log:
    """time (n,) s; duty (n, 2), each valid until the next row; channels that carry data; what is missing."""

    time: Array
    duty: Array
    channels: tuple[Channel, ...]
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())

    @property
    def seconds(self) -> float:
        """Length in s."""
        return float(self.time[-1] - self.time[0])

    def channel(self, role: str) -> Channel | None:
        """The channel with that role, or None."""
        return next((each for each in self.channels if each.role == role), None)

    def between(self, start: float, end: float) -> Log:
        """The part with start <= time < end."""
        keep = (self.time >= start) & (self.time < end)
        parts = tuple(
            Channel(each.name, each.role, each.unit, each.values[keep], each.floor) for each in self.channels
        )
        return Log(self.time[keep], self.duty[keep], parts, self.missing, self.notes)


ROLES = {
    "bemf_left": ("motor.{left}.bemf", "counts", 1.0),
    "bemf_right": ("motor.{right}.bemf", "counts", 1.0),
    "speed_left": ("motor.{left}.speed", "rad/s", 0.01),
    "speed_right": ("motor.{right}.speed", "rad/s", 0.01),
    "gyro": ("imu.gyro.z", "rad/s", 0.001),
    "battery": ("battery.voltage", "V", 0.004),
}
"""What the model can predict: column, unit, smallest believable noise."""
WHEELS = ("bemf_left", "bemf_right", "speed_left", "speed_right")


def log_from_columns(columns: Mapping[str, Array], robot: RobotConfig) -> Log:
    """Arrange the columns of a recording (names of the CSV format) for this robot.

    Raises TraceError for a recording without time or commands, with time that does not advance, or too short.
    """
    time = _time(columns)
    ports = {"left": robot.drive.left, "right": robot.drive.right}
    signs = {side: -1.0 if robot.motor(port).inverted else 1.0 for side, port in ports.items()}
    duty = np.column_stack([signs[side] * _command(columns, port) for side, port in ports.items()])
    channels, missing = [], []
    for role, (pattern, unit, floor) in ROLES.items():
        name = pattern.format(**ports)
        values = columns.get(name)
        if values is None or np.isfinite(values).sum() < 20:
            missing.append(name)
            continue
        sign = signs[role.rpartition("_")[2]] if role in WHEELS else 1.0
        channels.append(Channel(name, role, unit, sign * np.asarray(values, float), floor))
    return Log(time, duty, tuple(channels), tuple(missing))


def _time(columns: Mapping[str, Array]) -> Array:
    if "t" not in columns or len(columns["t"]) == 0:
        raise TraceError("the recording is empty: it has no samples with a time t")
    time = np.asarray(columns["t"], float)
    if not np.isfinite(time).all():
        raise TraceError(
            f"t is not a number in {int((~np.isfinite(time)).sum())} samples: repair the recording"
        )
    steps = np.diff(time)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 1
        raise TraceError(
            f"t goes from {time[row - 1]:.6g} s to {time[row]:.6g} s at row {row}: it must advance"
        )
    step = float(np.median(steps)) if len(steps) else 0.0
    if step > SLOWEST_STEP:
        guess = ": it looks like milliseconds, not seconds" if step >= 1.0 else ""
        raise TraceError(
            f"t advances by {step:.3g} s a sample{guess}; at most {SLOWEST_STEP:g} s are allowed"
        )
    if len(time) < 50 or time[-1] - time[0] < SHORTEST_SECONDS:
        raise TraceError(
            f"the recording has {len(time)} samples over {time[-1] - time[0]:.3g} s: "
            f"a diagnosis needs at least 50 over {SHORTEST_SECONDS:g} s"
        )
    return time


def _command(columns: Mapping[str, Array], port: int) -> Array:
    name = f"motor.{port}.duty"
    if name not in columns:
        held = sorted(each for each in columns if each.endswith(".duty")) or ["no commands at all"]
        raise TraceError(f"{name} is not in the recording: it holds {', '.join(held)}; is it this robot's?")
    duty = np.asarray(columns[name], float)
    known = np.flatnonzero(np.isfinite(duty))
    if len(known) == 0:
        raise TraceError(f"{name} holds no numbers")
    latest = np.maximum.accumulate(np.where(np.isfinite(duty), np.arange(len(duty)), known[0]))
    return np.asarray(duty[latest], float)
