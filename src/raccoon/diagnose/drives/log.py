"""A drive as the diagnosis sees it: time, commands and measurements; left before right."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.commands import commanded_duty, read_brakes
from raccoon.diagnose.drives.sample_clock import SampleClock
from raccoon.diagnose.drives.slow_rows import MAX_ROW_CYCLES, check_row_length
from raccoon.diagnose.drives.time_column import check_time
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]

MIN_DRIVE_S = 2.0
"""Shortest drive, s, that can be diagnosed."""
MIN_GAP_S = 0.1
"""Time between rows, s, above which the commands in between are unknown; over shorter losses they are
estimated (`habits/lost_commands.py`)."""
SETTLING_DRIVE_S = 0.3
"""Driving time, s, after which a robot has forgotten its initial speeds."""
ROLL_OUT_S = 1.0
"""Time, s, after which a robot that is not driven has come to rest."""
MAX_LISTED_GAPS = 3
"""Largest number of gaps whose times a note lists."""
MIN_READINGS = 20
"""Least number of readings of a channel."""


@dataclass(frozen=True, slots=True)
class Channel:
    """One sensor's samples. name: the recording's column. role: its name in the model. values: NaN where
    there is no new reading. floor: lower bound of its noise (the quantisation)."""

    name: str
    role: str
    unit: str
    values: Array
    floor: float


@dataclass(frozen=True, slots=True)
class Load:
    """A load on the battery other than the wheels. start, end: s. sag: V, usual drop of the battery's
    reading; negative if the span was left out of the drive because of the load. by: columns of devices that
    may be the load."""

    start: float
    end: float
    sag: float
    by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StepChange:
    """A step change during a drive. at: its time, s. of: what changed, "gyro" (its zero) or the side of a
    wheel."""

    at: float
    of: str


Clocks = tuple[SampleClock | None, SampleClock | None]


@dataclass(frozen=True, slots=True)
class Run:
    """One of several recordings joined in a log. start: time of its first row, s. clocks: as in `Log`."""

    start: float
    clocks: Clocks


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Log:
    """A drive. time (n,): s. duty (n, 2): each valid until the next row. channels: those with data. missing:
    columns without data.

    lost: spans (start, end), s, without rows or not driven freely, extended until the robot has settled;
    nothing is compared in them. held: spans, s, with rows, in which the robot was not driven freely
    (`obstructions.py`). clocks: sample clocks of the left and the right wheel, if known; the wheels' readings
    then all have an age of half a cycle, and commands wait for the clock. brake (n, 2): whether each motor is
    shorted at duty 0; None if not recorded. loads: on the battery, other than the wheels; nothing is compared
    while they act. stalls: a column and a sentence for each kind of wheel stall (`stalls.py`). runs: the
    recordings of a joined log (`log_joining.py`), empty for a single one. friction_may_change: whether
    friction may have changed during the drive. change: a step change that is known. separate_batteries:
    whether each of `runs` has its own battery.
    """

    time: Array
    duty: Array
    channels: tuple[Channel, ...]
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = field(default=())
    lost: tuple[tuple[float, float], ...] = ()
    held: tuple[tuple[float, float], ...] = ()
    clocks: Clocks = (None, None)
    brake: NDArray[np.bool_] | None = None
    loads: tuple[Load, ...] = ()
    stalls: tuple[tuple[str, str], ...] = ()
    runs: tuple[Run, ...] = ()
    friction_may_change: bool = False
    change: StepChange | None = None
    separate_batteries: bool = False

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return float(self.time[-1] - self.time[0])

    def channel(self, role: str) -> Channel | None:
        """The channel with this role, or None."""
        return next((each for each in self.channels if each.role == role), None)

    def wheel(self, side: str) -> Channel | None:
        """The channel that measures the wheel of a side: back-EMF, else an encoder, else None."""
        return self.channel(f"bemf_{side}") or self.channel(f"speed_{side}")

    def between(self, start: float, end: float) -> Log:
        """The part with start <= time < end."""
        keep = (self.time >= start) & (self.time < end)
        parts = tuple(replace(each, values=each.values[keep]) for each in self.channels)
        brake = None if self.brake is None else self.brake[keep]
        return replace(self, time=self.time[keep], duty=self.duty[keep], channels=parts, brake=brake)

    def without_spans(self, spans: Sequence[tuple[float, float]]) -> Log | None:
        """The log with further spans (start, end), s, in which the robot was not driven freely: nothing is
        compared in them and until the robot has settled after each. None if less than `MIN_DRIVE_S` would
        remain."""
        rows = np.minimum(np.searchsorted(self.time, [end for _, end in spans]), len(self.time) - 1)
        until = [settled_time(self.time, self.duty, int(row)) for row in rows]
        gone = ((start, end) for (start, _), end in zip(spans, until, strict=True))
        lost = tuple(sorted((*self.lost, *gone)))
        if self.seconds - sum(lengths_without_overlap(lost)) < MIN_DRIVE_S:
            return None
        return replace(self, lost=lost, held=tuple(sorted((*self.held, *spans))))

    def split_recordings(self) -> list[Log]:
        """The recordings of a joined log, each as a log of its own; a single recording as itself."""
        if not self.runs:
            return [self]
        starts = [each.start for each in self.runs]
        return [
            replace(self.between(run.start, end), clocks=run.clocks, runs=())
            for run, end in zip(self.runs, [*starts[1:], math.inf], strict=True)
        ]

    def longest_part(self) -> Log:
        """The longest part without a gap; the whole log if it has no gap."""
        cuts = [start for start, _ in self.lost] + [end for _, end in self.held]
        after = np.searchsorted(self.time, sorted(cuts), side="right")
        edges = [0, *(int(each) for each in after), len(self.time)]
        parts = [
            (self.time[end - 1] - self.time[start], start, end)
            for start, end in pairwise(edges)
            if start < end and not any(begin <= self.time[start] <= last for begin, last in self.held)
        ]
        _, start, end = max(parts, key=lambda each: each[0])
        part = self.between(float(self.time[start]), float(np.nextafter(self.time[end - 1], np.inf)))
        clocks = [each.clocks for each in self.runs if each.start <= part.time[0]] or [self.clocks]
        return replace(part, lost=(), held=(), clocks=clocks[-1], runs=())


ROLES = {
    "bemf_left": ("motor.{left}.bemf", "counts", 1.0),
    "bemf_right": ("motor.{right}.bemf", "counts", 1.0),
    "speed_left": ("motor.{left}.speed", "rad/s", 0.01),
    "speed_right": ("motor.{right}.speed", "rad/s", 0.01),
    "gyro": ("imu.gyro.z", "rad/s", 0.001),
    "battery": ("battery.voltage", "V", 0.004),
}
"""Channels that the model can predict: column, unit, lower bound of the noise in that unit."""
BEMF = ("bemf_left", "bemf_right")
WHEELS = (*BEMF, "speed_left", "speed_right")


def column_names(robot: RobotConfig) -> dict[str, str]:
    """The column of each role at this robot's ports."""
    ports = {"left": robot.drive.left, "right": robot.drive.right}
    return {role: pattern.format(**ports) for role, (pattern, _, _) in ROLES.items()}


def has_readings(columns: Mapping[str, Array], name: str) -> bool:
    """Whether a column exists and has enough readings for a channel."""
    return name in columns and int(np.isfinite(columns[name]).sum()) >= MIN_READINGS


def log_from_columns(columns: Mapping[str, Array], robot: RobotConfig) -> Log:
    """The log of a recording's columns (names as in the CSV format) for this robot.

    Raises TraceError for a recording without time or commands, with time that does not advance, with rows too
    far apart, or too short.
    """
    time = _checked_time(columns)
    log = arrange_columns(columns, robot)
    wheels = [(log.duty[:, side], log.wheel(name)) for side, name in enumerate(("left", "right"))]
    readings = [(duty, wheel.values) for duty, wheel in wheels if wheel is not None]
    gyro = log.channel("gyro")
    turns = [] if gyro is None else [(log.duty[:, 1] - log.duty[:, 0], gyro.values)]
    slow = check_row_length(median_step(time), robot.controller.rate_hz, readings, turns)
    lost, notes = _find_gaps(time, log.duty)
    return replace(log, notes=(*slow, *notes), lost=lost)


def arrange_columns(columns: Mapping[str, Array], robot: RobotConfig) -> Log:
    """The log without checks of the time and so without gaps, for comparisons of magnitudes alone.

    Raises TraceError for a recording without commands.
    """
    ports = {"left": robot.drive.left, "right": robot.drive.right}
    signs = {side: -1.0 if robot.motor(port).inverted else 1.0 for side, port in ports.items()}
    duty = np.column_stack([signs[side] * commanded_duty(columns, port) for side, port in ports.items()])
    channels, missing = [], []
    for role, name in column_names(robot).items():
        if not has_readings(columns, name):
            missing.append(name)
            continue
        _, unit, floor = ROLES[role]
        sign = signs[role.rpartition("_")[2]] if role in WHEELS else 1.0
        channels.append(Channel(name, role, unit, sign * np.asarray(columns[name], float), floor))
    time, brake = np.asarray(columns["t"], float), read_brakes(columns, list(ports.values()))
    return Log(time, duty, tuple(channels), tuple(missing), brake=brake)


def _checked_time(columns: Mapping[str, Array]) -> Array:
    if "t" not in columns or len(columns["t"]) == 0:
        raise TraceError("the recording is empty: it has no samples with a time t")
    time = np.asarray(columns["t"], float)
    check_time(time)
    if len(time) < 50 or time[-1] - time[0] < MIN_DRIVE_S:
        raise TraceError(
            f"the recording has {len(time)} sample{'s' * (len(time) != 1)} over "
            f"{_rounded_down(time[-1] - time[0]):g} s: "
            f"a diagnosis needs at least 50 over {MIN_DRIVE_S:g} s"
        )
    return time


def _rounded_down(seconds: float) -> float:
    """Seconds rounded down to ms, so that a duration that is too short is not printed as the required one."""
    return math.floor(1000.0 * seconds + 1e-6) / 1000.0


def _find_gaps(time: Array, duty: Array) -> tuple[tuple[tuple[float, float], ...], tuple[str, ...]]:
    """The spans (start, end), s, that are not compared because rows are missing, and notes on them."""
    steps = np.diff(time)
    usual = float(np.median(steps))
    ends = np.flatnonzero(steps > max(MIN_GAP_S, 2.0 * MAX_ROW_CYCLES * usual)) + 1
    if len(ends) == 0:
        return (), ()
    lost = tuple((float(time[end - 1] + usual), settled_time(time, duty, int(end))) for end in ends)
    left = float(time[-1] - time[0]) - sum(lengths_without_overlap(lost))
    gaps = ", ".join(f"{time[end - 1]:.1f} to {time[end]:.1f} s" for end in ends[:MAX_LISTED_GAPS])
    more = ", ..." if len(ends) > MAX_LISTED_GAPS else ""
    count = "1 gap" if len(ends) == 1 else f"{len(ends)} gaps"
    told = f"no rows from {gaps}{more}: {count}, {float(steps[ends - 1].sum()):.1f} s in all"
    if left < MIN_DRIVE_S:
        raise TraceError(f"{told}; a diagnosis needs at least {MIN_DRIVE_S:g} s without gaps")
    return lost, (f"{told}; what happened there, and until the robot has settled after it, is not judged",)


def settled_time(time: Array, duty: Array, row: int) -> float:
    """Time, s, from which the motion before a row no longer matters: after `SETTLING_DRIVE_S` of driving both
    wheels, at the latest after `ROLL_OUT_S`."""
    steps = np.diff(time[row:], append=time[-1])
    driven = np.cumsum(np.where(np.all(duty[row:] != 0.0, axis=1), steps, 0.0))
    enough = np.flatnonzero(driven >= SETTLING_DRIVE_S)
    latest = float(time[row]) + ROLL_OUT_S
    return min(latest, float(time[row + enough[0]])) if len(enough) else latest


def lengths_without_overlap(lost: Sequence[tuple[float, float]]) -> list[float]:
    """Length (s) of each span without what earlier spans cover. lost: sorted by start."""
    found, reached = [], -math.inf
    for start, end in lost:
        found.append(max(end - max(start, reached), 0.0))
        reached = max(reached, end)
    return found
