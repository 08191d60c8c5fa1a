"""Back-EMF derived from position counters, for drives without another reading of their wheels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import HoldoutError, TraceError
from raccoon.core.readings import Device
from raccoon.diagnose.drives.log import MIN_READINGS, has_readings
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict
from raccoon.diagnose.rollout.dead_zone_evidence import ZONE
from raccoon.trace.recording import median_step, ports_in

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

AVERAGING_S = 0.015
"""Time over which a counter is differenced, s: a tick in 5 ms is 200 counts, as many as a creeping wheel
reads. Anything faster than 20 ms is averaged out anyway. A counter that does not change for this time is a
reading of 0."""
ROW_TOLERANCE = 0.05
"""Tolerance, in rows, by which a mean may be shorter than `AVERAGING_S`: with rows of 5 ms and rounded times
it takes three rows."""
MAX_GAP_RATIO = 1.5
"""Factor on the usual duration of such rows above which there is a gap in them."""
MIN_ZONE_SIGMAS = 3.5
"""Standard deviations by which a dead zone must be wider than the counter's tick, the same as for other
parameters' differences from robot.toml."""
MIN_RESET_JUMP_RATIO = 20.0
"""Least jump of a reset counter, relative to its usual largest step per row."""


@dataclass(frozen=True, slots=True)
class CounterBemf:
    """Columns with back-EMF derived from counters for wheels without a reading. counters: columns from which
    it was derived. hidden_counts: back-EMF below which a counter in whole ticks shows nothing."""

    columns: Columns
    counters: tuple[str, ...] = ()
    hidden_counts: float = 0.0

    def annotate(self, found: Diagnosis) -> Diagnosis:
        """The diagnosis of these columns with a note, and without a dead zone that may only be the counter's
        tick."""
        if not self.counters:
            return found
        readings = " and ".join(_bemf_name(each) for each in self.counters)
        note = (
            f"{readings} {'is' if len(self.counters) == 1 else 'are'} missing: derived from "
            f"{' and '.join(self.counters)}"
        )
        zones = {each.name: each.parameters["counts"] for each in found.causes if each.id == ZONE}
        hidden_zones = [
            name
            for name, each in zones.items()
            if each.value < self.hidden_counts + MIN_ZONE_SIGMAS * each.std
        ]
        found = self._without_zones(found, hidden_zones) if hidden_zones else found
        return replace(found, notes=(*found.notes, note))

    def _without_zones(self, found: Diagnosis, names: list[str]) -> Diagnosis:
        remaining = [each for each in found.causes if each.name not in names]
        ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(remaining, start=1))
        is_adequate = found.verdict is Verdict.EXPLAINED and all(each.is_negligible for each in ranked)
        reason = (
            f"not identifiable: whole ticks of {' and '.join(self.counters)} hide readings below "
            f"{self.hidden_counts:.2g} counts as such a zone does"
        )
        model = found.model
        if model is not None:
            other_effects = {key: values for key, values in model.effects.items() if key[0] != ZONE}
            model = replace(model, effects=other_effects)
        return replace(
            found,
            verdict=Verdict.ADEQUATE if is_adequate else found.verdict,
            causes=ranked,
            rejected=(*found.rejected, *(Rejected(each, reason) for each in names)),
            model=model,
        )


def with_counter_bemf(columns: Columns, robot: RobotConfig, device: Device) -> CounterBemf:
    """The columns with back-EMF (counts) derived from `motor.N.position` for wheels with neither back-EMF nor
    speed. The worth of a tick is the device's."""
    derived, counters = dict(columns), []
    for port in (robot.drive.left, robot.drive.right):
        counter, reading = f"motor.{port}.position", f"motor.{port}.bemf"
        if any(has_readings(columns, each) for each in (reading, f"motor.{port}.speed")):
            continue
        if has_readings(columns, counter):
            derived[reading] = device.position_counts_seconds * _tick_rate(columns["t"], columns[counter])
            counters.append(counter)
    has_whole_ticks = any(bool((np.nan_to_num(columns[each]) % 1.0 == 0.0).all()) for each in counters)
    return CounterBemf(
        derived, tuple(counters), device.position_counts_seconds / AVERAGING_S if has_whole_ticks else 0.0
    )


def counter_reset_notes(columns: Columns, robot: RobotConfig) -> tuple[str, ...]:
    """A note if both counters jump once, in the same row, which is the only sign of two drives that were
    joined at rest. A program that clears its counters for each motion does so more often."""
    names = [f"motor.{port}.position" for port in (robot.drive.left, robot.drive.right)]
    if not all(has_readings(columns, each) for each in names):
        return ()
    known = np.flatnonzero(np.isfinite(columns[names[0]]) & np.isfinite(columns[names[1]]))
    if len(known) < MIN_READINGS:
        return ()
    steps = np.abs([np.diff(columns[each][known]) for each in names])
    usual_steps = np.percentile(steps, 99.0, axis=1, keepdims=True)
    rows = known[1:][(steps > MIN_RESET_JUMP_RATIO * np.maximum(usual_steps, 1.0)).all(axis=0)]
    if len(rows) != 1:
        return ()
    row = int(rows[0])
    return (
        f"{' and '.join(names)} restart at {columns['t'][row]:.1f} s, row {row}: does a program clear them, "
        "or were two recordings put together? Then diagnose each by itself",
    )


@contextmanager
def counters_named_in_errors(columns: Columns) -> Iterator[None]:
    """Adds the counter's name to errors on back-EMF that was derived from it, since only the counter is in
    the file."""
    try:
        yield
    except HoldoutError:
        raise
    except TraceError as error:
        text = str(error)
        for port in ports_in(columns, "motor", "position"):
            counter = f"motor.{port}.position"
            if _bemf_name(counter) not in columns:
                text = text.replace(_bemf_name(counter), f"{_bemf_name(counter)} (as {counter} advances)")
        raise TraceError(text) from error


def _tick_rate(time: Array, ticks: Array) -> Array:
    """Ticks per second: mean over an odd number of known rows, placed at their middle row; NaN in other rows,
    and over a gap, in which the wheel's motion is unknown.

    A counter grows by what is read in a row, so between two rows it grows by the readings of the later ones.
    """
    known = np.flatnonzero(np.isfinite(ticks))
    row = max(median_step(time[known]), 1e-6)
    half = int(np.ceil(0.5 * (AVERAGING_S / row - 1.0) - ROW_TOLERANCE))
    rows = max(2 * half + 1, 1)
    ends = known[::rows]
    spans = np.diff(time[ends])
    has_no_gap = (spans > 0.0) & (spans < MAX_GAP_RATIO * rows * row)
    found = np.full(len(time), np.nan)
    found[known[rows - half :: rows][: len(spans)][has_no_gap]] = (
        np.diff(ticks[ends])[has_no_gap] / spans[has_no_gap]
    )
    return found


def _bemf_name(counter: str) -> str:
    return f"{counter.removesuffix('position')}bemf"
