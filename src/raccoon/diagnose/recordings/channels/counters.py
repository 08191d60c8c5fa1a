"""Drives of which only the controller's counters were recorded: the back-EMF that these sum."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import HoldoutError, TraceError
from raccoon.core.readings import Device
from raccoon.diagnose.drives.log import FEWEST, is_read
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict
from raccoon.diagnose.rollout.dead_zone_evidence import ZONE
from raccoon.trace.recording import ports_in, usual_step

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

AVERAGED = 0.015
"""s over which a counter is differenced: a tick in 5 ms is 200 counts, as many as a wheel that creeps has.
What is faster than 20 ms is averaged out in any case. A counter that does not change for as long says what a
reading of 0 does."""
NEARLY = 0.05
"""Rows by which as many may be less than that: of rows of 5 ms, as their times are written, it is three."""
LONGER = 1.5
"""Times as long as usual, from which there is a gap in such rows."""
SURELY = 3.5
"""Standard deviations by which a dead zone must be wider than what a counter hides, as of a number outside
robot.toml's."""
FAR = 20.0
"""Times what a wheel turns in a row at most, by which a counter jumps that begins anew."""


@dataclass(frozen=True, slots=True)
class Counted:
    """Columns in which wheels without a reading have the one that their counter sums. counters: columns that
    were taken for it. slowest: back-EMF counts that a counter in whole ticks hides."""

    columns: Columns
    counters: tuple[str, ...] = ()
    slowest: float = 0.0

    def told(self, found: Diagnosis) -> Diagnosis:
        """A diagnosis of these columns that says so, without a dead zone that is only the counter's tick."""
        if not self.counters:
            return found
        readings = " and ".join(_reading(each) for each in self.counters)
        note = (
            f"{readings} {'is' if len(self.counters) == 1 else 'are'} missing: taken from how "
            f"{' and '.join(self.counters)} advance{'s' if len(self.counters) == 1 else ''}"
        )
        zones = {each.name: each.parameters["counts"] for each in found.causes if each.id == ZONE}
        own = [name for name, each in zones.items() if each.value < self.slowest + SURELY * each.std]
        found = self._without(found, own) if own else found
        return replace(found, notes=(*found.notes, note))

    def _without(self, found: Diagnosis, names: list[str]) -> Diagnosis:
        kept = [each for each in found.causes if each.name not in names]
        ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(kept, start=1))
        nothing = found.verdict is Verdict.EXPLAINED and all(each.little for each in ranked)
        reason = (
            f"not identifiable: whole ticks of {' and '.join(self.counters)} hide readings below "
            f"{self.slowest:.2g} counts as such a zone does"
        )
        model = found.model
        if model is not None:
            zone = {key: values for key, values in model.effects.items() if key[0] != ZONE}
            model = replace(model, effects=zone)
        return replace(
            found,
            verdict=Verdict.ADEQUATE if nothing else found.verdict,
            causes=ranked,
            rejected=(*found.rejected, *(Rejected(each, reason) for each in names)),
            model=model,
        )


def with_counted(columns: Columns, robot: RobotConfig, device: Device) -> Counted:
    """The columns with back-EMF in counts by `motor.N.position`, of wheels with neither that nor a speed.

    A tick is worth what the device says.
    """
    made, used = dict(columns), []
    for port in (robot.drive.left, robot.drive.right):
        counter, reading = f"motor.{port}.position", f"motor.{port}.bemf"
        if any(is_read(columns, each) for each in (reading, f"motor.{port}.speed")):
            continue
        if is_read(columns, counter):
            made[reading] = device.position_counts_seconds * _rate(columns["t"], columns[counter])
            used.append(counter)
    whole = any(bool((np.nan_to_num(columns[each]) % 1.0 == 0.0).all()) for each in used)
    return Counted(made, tuple(used), device.position_counts_seconds / AVERAGED if whole else 0.0)


def begun_anew(columns: Columns, robot: RobotConfig) -> tuple[str, ...]:
    """A note where both wheels' counters jump once and in one row: of two drives that meet at rest no reading
    shows more. A program that clears them for each motion does it more often."""
    names = [f"motor.{port}.position" for port in (robot.drive.left, robot.drive.right)]
    if not all(is_read(columns, each) for each in names):
        return ()
    known = np.flatnonzero(np.isfinite(columns[names[0]]) & np.isfinite(columns[names[1]]))
    if len(known) < FEWEST:
        return ()
    steps = np.abs([np.diff(columns[each][known]) for each in names])
    most = np.percentile(steps, 99.0, axis=1, keepdims=True)
    rows = known[1:][(steps > FAR * np.maximum(most, 1.0)).all(axis=0)]
    if len(rows) != 1:
        return ()
    row = int(rows[0])
    return (
        f"{' and '.join(names)} begin anew at {columns['t'][row]:.1f} s, row {row}: a program that clears "
        "them, or two recordings that were put together? Then diagnose each by itself",
    )


@contextmanager
def said_of_counters(columns: Columns) -> Iterator[None]:
    """An error of a reading that is made of a counter, with the counter's name: no other is in the file."""
    try:
        yield
    except HoldoutError:
        raise
    except TraceError as error:
        text = str(error)
        for port in ports_in(columns, "motor", "position"):
            counter = f"motor.{port}.position"
            if _reading(counter) not in columns:
                text = text.replace(_reading(counter), f"{_reading(counter)} (as {counter} advances)")
        raise TraceError(text) from error


def _rate(time: Array, ticks: Array) -> Array:
    """Ticks a second: the mean over an odd number of rows that have any, in the middle one of these; NaN in
    the others, and over a gap, in which a wheel may have done anything.

    A counter grows by what is read in a row, so between two rows it grows by the later ones' readings.
    """
    known = np.flatnonzero(np.isfinite(ticks))
    row = max(usual_step(time[known]), 1e-6)
    half = int(np.ceil(0.5 * (AVERAGED / row - 1.0) - NEARLY))
    rows = max(2 * half + 1, 1)
    ends = known[::rows]
    spans = np.diff(time[ends])
    whole = (spans > 0.0) & (spans < LONGER * rows * row)
    found = np.full(len(time), np.nan)
    found[known[rows - half :: rows][: len(spans)][whole]] = np.diff(ticks[ends])[whole] / spans[whole]
    return found


def _reading(counter: str) -> str:
    return f"{counter.removesuffix('position')}bemf"
