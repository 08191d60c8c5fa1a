"""Recordings as columns: SI units, one array a channel, NaN if a sensor gave nothing new.

Analysis and the CSV interchange format share this form; names and units are those of docs/trace-format.md. A
trace keeps raw words and replays bit for bit; a recording holds the values that the words mean.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.errors import TraceError
from raccoon.core.near_names import did_you_mean
from raccoon.core.readings import SI_WORDS, Device
from raccoon.trace.format import Event

Column = NDArray[np.float64]
EVENT = "event"
"""Name of the column or topic of remarks, in every form of a recording."""
TIME_UNITS = ((1e6, "nanoseconds"), (1e3, "microseconds"), (1.0, "milliseconds"))
"""Steps in time per sample from which `t` is probably in another unit than seconds, and that unit."""
SLOW_CLOCK = 5.0
"""Step below which milliseconds may also be hundredths of a second."""
DUTY_UNITS = (
    (2.0, "fractions of something smaller than full power"),
    (13.0, "volts (column motor.N.voltage) or percent"),
    (100.0, "percent"),
    (255.0, "PWM of 8 bits (-255..255)"),
    (400.0, "a Wombat's PWM (-400..400)"),
    (1500.0, "ticks a second (-1500..1500), which are a speed, or PWM of 10 bits (-1023..1023)"),
)
"""Sizes up to which a command is probably of the given other unit."""
MAX_OUT_OF_RANGE_SHARE = 0.02
"""Largest share of a command's rows that may be beyond -1..1; with more, the command has another unit."""
MIN_OUT_OF_RANGE_ROWS = 10
"""Number of such rows that proves nothing yet."""
DUTY = re.compile(r"motor\.\d+\.duty")
SURFACE = re.compile(r"truth\.surface\.\d+")
_OF_SAMPLES = re.compile(r"(motor|imu|analog|truth)\..+")
_FLAG = re.compile(r"digital\.\d+|motor\.\d+\.brake|fault\..+")


@dataclass(slots=True)
class Recording:
    """Columns of equal length by name; `t` is required.

    events: remarks; their tick is the row. A column of numbers named `event` becomes remarks. device: the
    units of the words, which are SI_WORDS except for the position counter, whose ticks differ between
    controllers, and the name of the controller, if known. problems: what a reader had to leave out. Raises
    TraceError if t is missing, not finite or goes back, if lengths differ, and for a column that does not
    contain numbers.
    """

    columns: dict[str, Column]
    events: list[Event] = field(default_factory=list)
    device: Device = SI_WORDS
    problems: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if "t" not in self.columns:
            raise TraceError(f"there is no column t; there are {_listed(self.columns)}")
        self.columns = {name: as_float_column(name, column) for name, column in self.columns.items()}
        check_lengths(self.columns)
        _check_time(self.columns["t"])
        if EVENT in self.columns:  # numbers of events; no form can have two columns of one name
            numbers = self.columns.pop(EVENT)
            rows = np.flatnonzero(np.isfinite(numbers)).tolist()
            remarks = [Event(row, repr(float(numbers[row])).removesuffix(".0")) for row in rows]
            self.events = sorted([*self.events, *remarks], key=lambda each: each.tick)

    def __len__(self) -> int:
        return len(self.columns["t"])

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> Column:
        """A column. Raises TraceError naming it and those that exist."""
        if name not in self.columns:
            meant = did_you_mean(name, self.columns)
            raise TraceError(f"there is no column {name}{meant}; there are {_listed(self.columns)}")
        return self.columns[name]

    @property
    def has_truth(self) -> bool:
        """Whether it contains the pose of a reference system."""
        return all(f"truth.{name}" in self.columns for name in ("x", "y", "heading"))

    def check_finite(self) -> None:
        """Raise TraceError for an infinite value, which no form can represent."""
        for name, column in self.columns.items():
            for row in np.flatnonzero(np.isinf(column))[:1].tolist():
                raise TraceError(
                    f"column {name}, row {row}: {float(column[row])}: allowed are finite numbers and NaN"
                )

    def fingerprint(self) -> str:
        """A hash that is equal for two recordings of the same samples, whatever their files, forms and
        clocks."""
        found = hashlib.sha256()
        for name in sorted(each for each in self.columns if _OF_SAMPLES.fullmatch(each)) or ["t"]:
            found.update(name.encode())
            found.update((self.columns[name] + 0.0).tobytes())  # -0 is 0
        return found.hexdigest()

    def ports(self, kind: str, channel: str | None = None) -> list[int]:
        """Port numbers that have a column, such as ports("motor", "bemf") or ports("analog")."""
        return ports_in(self.columns, kind, channel)


def as_float_column(name: str, values: ArrayLike) -> Column:
    """A column's values as an array. Raises TraceError naming the column if it contains anything but
    numbers."""
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise TraceError(
            f"column {name}: {error}: allowed are numbers, and NaN where there is none"
        ) from None


def check_lengths(columns: Mapping[str, Column]) -> None:
    """Raise TraceError naming a column that is not as long as t."""
    rows = len(columns["t"])
    for name, each in columns.items():
        if np.shape(each) != (rows,):
            raise TraceError(f"column {name} has shape {np.shape(each)}: it must be ({rows},) as t")


def ports_in(names: Iterable[str], kind: str, channel: str | None = None) -> list[int]:
    """Port numbers in these column names (see `Recording.ports`). Names without a number are ignored: they
    are of other programs."""
    found = []
    for name in names:
        match name.split("."):
            case [first, number] if channel is None and first == kind and number.isdecimal():
                found.append(int(number))
            case [first, number, last] if first == kind and last == channel and number.isdecimal():
                found.append(int(number))
    return sorted(found)


def median_step(time: Column) -> float:
    """Median step of `time`, s; 0 for a single sample."""
    return float(np.median(np.diff(time))) if len(time) > 1 else 0.0


def time_unit_hint(step: float) -> str:
    """The probable unit of a time that should be in seconds and advances by `step` a sample, as a message; ""
    if it may be in seconds."""
    unit = next((name for least, name in TIME_UNITS if step >= least), None)
    if unit is None:
        return ""
    if step < SLOW_CLOCK:  # sampling periods of 10 to 50 ms are as common as 1 to 5 ms
        unit += " or hundredths of a second"
    guess = f"{unit}, or numbers of rows" if step == 1.0 else unit
    return f"t advances by {step:.3g} s a sample: it looks like {guess}, not seconds"


def duty_unit_hint(largest: float) -> str:
    """The probable unit of a command that reaches `largest`, beyond -1..1, as a part of a message."""
    return f"it looks like {next((unit for most, unit in DUTY_UNITS if largest <= most), 'another unit')}"


def allowed_values(name: str, value: float) -> str:
    """The values that a column allows, if this finite value is not among them, else ""."""
    if SURFACE.fullmatch(name):
        return "" if value in (0.0, 1.0) else "black, white"
    if _FLAG.fullmatch(name):
        return "" if value in (0.0, 1.0) else "0, 1"
    return "numbers from -1 to 1" if DUTY.fullmatch(name) and not -1.0 <= value <= 1.0 else ""


class OutOfRangeDuties:
    """Collects the commands beyond -1..1 that a reader finds: many of them mean another unit."""

    def __init__(self) -> None:
        self._sizes: dict[str, list[float]] = {}

    def add(self, name: str, value: float) -> None:
        """Add a value that its column does not allow; columns other than duties are ignored."""
        if DUTY.fullmatch(name):
            self._sizes.setdefault(name, []).append(abs(value))

    def unit_hint(self) -> str:
        """The probable unit of these commands, as a message; "" if there are none."""
        largest = max((size for sizes in self._sizes.values() for size in sizes), default=None)
        return "" if largest is None else f"commands reach {largest:g}: {duty_unit_hint(largest)}"

    def check(self, rows: int) -> None:
        """Raise TraceError if so many of the `rows` of a command are out of range that it has another
        unit."""
        for name, sizes in self._sizes.items():
            if len(sizes) > max(MAX_OUT_OF_RANGE_SHARE * rows, MIN_OUT_OF_RANGE_ROWS):
                raise TraceError(
                    f"{name} is beyond -1..1 in {len(sizes)} of {rows} rows and reaches {max(sizes):g}: "
                    f"{duty_unit_hint(max(sizes))}"
                )


def _check_time(time: Column) -> None:
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise TraceError(f"row {bad[0]}: t is {float(time[bad[0]])}: it must be a finite number")
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        row = int(back[0]) + 1
        raise TraceError(f"row {row}: t is {float(time[row])}: it goes back from {float(time[row - 1])}")


def _listed(columns: dict[str, Column]) -> str:
    names = list(columns)
    return ", ".join(names[:20]) + (", ..." if len(names) > 20 else "") or "none"
