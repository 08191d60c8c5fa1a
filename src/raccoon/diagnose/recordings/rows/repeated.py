"""Rows that say nothing new: written twice, at one time or with all that was in the row before, or empty."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.trace.recording import check_lengths

Columns = Mapping[str, NDArray[np.float64]]

FEWEST = 200
"""Rows that tell how often they repeat."""
MOST_REPEATED = 0.1
"""Share of the samples. More are no slip of a recorder, and are left to be refused, unless each holds nothing
but the sample before once more."""


def without_repeated(columns: Columns) -> tuple[Columns, tuple[str, ...]]:
    """The columns without samples whose time is that of the one before, and what is to be said of it.

    Raises TraceError where a column is not as long as t.
    """
    time = columns.get("t", np.zeros(0))
    again = np.flatnonzero(np.diff(time) == 0.0) + 1
    if len(again) == 0:
        return columns, ()
    check_lengths(columns)
    if len(again) > MOST_REPEATED * len(time) and not _as_before(columns)[again].all():
        return columns, ()
    one = len(again) == 1
    said = (
        f"{len(again)} {'sample has' if one else 'samples have'} the time of the one before and "
        f"{'is' if one else 'are'} left out: the first at {time[again[0]]:.6g} s, row {again[0]}"
    )
    return {name: np.delete(each, again) for name, each in columns.items()}, (said,)


def _as_before(columns: Columns) -> NDArray[np.bool_]:
    """Rows that hold in all columns but t what the row before holds."""
    same = np.arange(len(columns["t"])) > 0
    for name, each in columns.items():
        if name != "t":
            same[1:] &= (each[1:] == each[:-1]) | (np.isnan(each[1:]) & np.isnan(each[:-1]))
    return same


def without_empty(columns: Columns) -> Columns:
    """The columns without rows that hold nothing but their time: nobody knows what was commanded then, so
    they are as good as lost. All of them where no row holds more."""
    rest = [np.isfinite(each) for name, each in columns.items() if name != "t"]
    some = np.any(rest, axis=0)
    if "t" not in columns or not some.any() or some.all():
        return columns
    return {name: each[some] for name, each in columns.items()}


FASTER = 0.3
"""Share of the rows of a robot that is driven that are as the row before, where a logger is faster than what
it reads. Of noise no row is."""
FEWEST_NEW = 3
"""Rows of a robot that is driven that are new. With fewer no logger is too fast: nothing changes at all."""
EARLY = 0.8
"""Part of the usual time between rows that are new, before which one that is not says nothing."""


def without_held(columns: Columns) -> tuple[Columns, tuple[str, ...]]:
    """The columns without rows in which a logger wrote once more what it had, and what is to be said of it.

    Such rows were a command that is 4 ms late and wheels that slip, each with a probability of 1.
    """
    commands = [each for name, each in columns.items() if name.endswith((".duty", ".voltage"))]
    readings = [each for name, each in columns.items() if name.endswith((".bemf", ".speed"))]
    time = columns.get("t", np.zeros(0))
    if not commands or not readings or len(time) < FEWEST or (np.diff(time) <= 0.0).any():
        return columns, ()  # of a time that stands still nobody knows what was when
    known = np.asarray(np.isfinite(np.column_stack(readings)).all(axis=1), bool)
    driven = np.abs(np.nan_to_num(np.column_stack(commands))).max(axis=1) > 0.0
    same = _as_before(columns) & known & np.concatenate([[False], known[:-1]])
    if driven.sum() < FEWEST or float(same[driven].mean()) < FASTER:
        return columns, ()
    new = time[~same & driven]
    if len(new) < FEWEST_NEW:
        return columns, ()
    usual = float(np.median(np.diff(new)))
    keep, last = ~same, float("-inf")
    for row in range(len(time)):
        keep[row] |= time[row] - last > EARLY * usual
        last = float(time[row]) if keep[row] else last
    if keep.all():  # readings in few steps, of a robot that drives evenly
        return columns, ()
    said = (
        f"{int((~keep).sum())} of {len(time)} rows hold what the row before held: the logger is faster than "
        f"what it reads, which is new every {1000.0 * usual:.3g} ms; they are left out"
    )
    return {name: each[keep] for name, each in columns.items()}, (said,)
