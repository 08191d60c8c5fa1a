"""Removes rows without new information: duplicate times, held values, and empty rows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.trace.recording import check_lengths

Columns = Mapping[str, NDArray[np.float64]]

MIN_ROWS = 200
"""Least number of rows for a check of held values."""
MAX_REPEATED_SHARE = 0.1
"""Largest share of samples with the time of the one before. More are no glitch of a recorder, and are left
for `check_time` to reject unless each only repeats the sample before."""


def without_duplicate_times(columns: Columns) -> tuple[Columns, tuple[str, ...]]:
    """The columns without samples that have the time of the one before, and a note on these.

    Raises TraceError if a column is not as long as t.
    """
    time = columns.get("t", np.zeros(0))
    duplicates = np.flatnonzero(np.diff(time) == 0.0) + 1
    if len(duplicates) == 0:
        return columns, ()
    check_lengths(columns)
    if (
        len(duplicates) > MAX_REPEATED_SHARE * len(time)
        and not _equals_previous_row(columns)[duplicates].all()
    ):
        return columns, ()
    one = len(duplicates) == 1
    note = (
        f"{len(duplicates)} {'sample has' if one else 'samples have'} the time of the one before and "
        f"{'is' if one else 'are'} left out: the first at {time[duplicates[0]]:.6g} s, row {duplicates[0]}"
    )
    return {name: np.delete(each, duplicates) for name, each in columns.items()}, (note,)


def _equals_previous_row(columns: Columns) -> NDArray[np.bool_]:
    """Whether each row equals the row before in all columns but t."""
    same = np.arange(len(columns["t"])) > 0
    for name, each in columns.items():
        if name != "t":
            same[1:] &= (each[1:] == each[:-1]) | (np.isnan(each[1:]) & np.isnan(each[:-1]))
    return same


def without_empty_rows(columns: Columns) -> Columns:
    """The columns without rows that hold only a time: their commands are unknown, so they count as lost. All
    rows if none holds more."""
    known = [np.isfinite(each) for name, each in columns.items() if name != "t"]
    filled = np.any(known, axis=0)
    if "t" not in columns or not filled.any() or filled.all():
        return columns
    return {name: each[filled] for name, each in columns.items()}


MIN_HELD_SHARE = 0.3
"""Share of driven rows that equal the row before above which a logger is faster than its source. Readings
with noise never equal the row before."""
MIN_NEW_ROWS = 3
"""Least number of driven rows with new values; with fewer nothing changes at all, and the logger is not too
fast."""
EARLY_FRACTION = 0.8
"""Share of the usual time between new rows before which an unchanged row is a held one."""


def without_held_rows(columns: Columns) -> tuple[Columns, tuple[str, ...]]:
    """The columns without rows in which a logger only held the last values, and a note on these.

    Such rows were diagnosed as commands that are 4 ms late and as wheel slip, each with a probability of 1.
    """
    commands = [each for name, each in columns.items() if name.endswith((".duty", ".voltage"))]
    readings = [each for name, each in columns.items() if name.endswith((".bemf", ".speed"))]
    time = columns.get("t", np.zeros(0))
    if not commands or not readings or len(time) < MIN_ROWS or (np.diff(time) <= 0.0).any():
        return columns, ()  # the order of rows is unknown if the time does not advance
    known = np.asarray(np.isfinite(np.column_stack(readings)).all(axis=1), bool)
    driven = np.abs(np.nan_to_num(np.column_stack(commands))).max(axis=1) > 0.0
    unchanged = _equals_previous_row(columns) & known & np.concatenate([[False], known[:-1]])
    if driven.sum() < MIN_ROWS or float(unchanged[driven].mean()) < MIN_HELD_SHARE:
        return columns, ()
    new = time[~unchanged & driven]
    if len(new) < MIN_NEW_ROWS:
        return columns, ()
    period = float(np.median(np.diff(new)))
    keep, last = ~unchanged, float("-inf")
    for row in range(len(time)):
        keep[row] |= time[row] - last > EARLY_FRACTION * period
        last = float(time[row]) if keep[row] else last
    if keep.all():  # coarse readings at constant speed
        return columns, ()
    note = (
        f"{int((~keep).sum())} of {len(time)} rows repeat the row before: the logger is faster than what it "
        f"reads, which changes every {1000.0 * period:.3g} ms; they are left out"
    )
    return {name: each[keep] for name, each in columns.items()}, (note,)
