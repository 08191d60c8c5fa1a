"""Checks of a recording's time column: it advances, is in seconds, and has small enough steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.trace.recording import median_step, time_unit_hint

Array = NDArray[np.float64]

MAX_STEP_S = 0.2
"""Longest time between samples, s; a wheel settles in less."""
MAX_GAP_S = 1e5
"""Longest pause of a drive, s; a longer one is an error of the time."""
MIN_DRIFT_S = 0.00125
"""Standard deviation in s of row times from an even clock, from which rows drift: a quarter of a firmware's
cycle of 5 ms. Rows that are woken by a timer stay within some tenths of a millisecond of it."""
MIN_STILL_SHARE = 0.1
"""Share of rows without an advance of the time above which the time is rounded."""


def check_time(time: Array, slowest: float = MAX_STEP_S) -> None:
    """Raise TraceError if a time is not a number, does not advance, or its usual step is above `slowest`
    (s)."""
    if not np.isfinite(time).all():
        raise TraceError(
            f"t is not a number in {int((~np.isfinite(time)).sum())} samples: repair the recording"
        )
    steps = np.diff(time)
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0)) + 1
        raise TraceError(
            f"t goes from {time[row - 1]:.12g} s to {time[row]:.12g} s at row {row}: it must advance"
            + _describe_rounding(steps)
        )
    if float(steps.max(initial=0.0)) > MAX_GAP_S:
        row = int(np.argmax(steps)) + 1
        raise TraceError(f"t jumps from {time[row - 1]:.12g} s to {time[row]:.12g} s at row {row}")
    check_step(time, slowest)


def check_step(time: Array, slowest: float = MAX_STEP_S) -> None:
    """Raise TraceError if the median step of the time is above `slowest` (s), as in another unit."""
    step = median_step(time)
    if step > slowest:
        told = (
            time_unit_hint(step)
            or f"t advances by {step:.3g} s a sample, as if it were in hundredths of a second"
        )
        raise TraceError(f"{told}; at most {slowest:g} s are allowed")


def rows_drift(time: Array) -> bool:
    """Whether no clock with an even step is behind the rows (s), as in a program that sleeps between them:
    then each shows a sample that is up to a cycle of the controller old, whatever that cycle is. Lost rows
    do not count."""
    usual = median_step(time)
    if not usual > 0.0:
        return False
    steps = np.diff(time)
    late = np.cumsum(steps - usual * np.round(steps / usual))
    rows = np.arange(len(late))
    even = np.polynomial.Polynomial.fit(rows, late, 1)(rows) if len(late) > 1 else late
    return float(np.std(late - even)) > MIN_DRIFT_S


def _describe_rounding(steps: Array) -> str:
    """Text that says that the time is rounded too coarsely, if it stands still often enough; "" otherwise."""
    still, moved = float((steps == 0.0).mean()), steps[steps > 0.0]
    if still == 1.0:
        return ", and never does: it seems to be written with too few digits"
    if still < MIN_STILL_SHARE or not len(moved):
        return ""
    return (
        f", and stands still in {100.0 * still:.0f} % of the rows: it seems to be rounded to "
        f"{float(np.median(moved)):.2g} s; write it to a tenth of a millisecond"
    )
