"""Selects the rows of a recording that are used: each once, and no more than can be simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log_joining import naming_recording
from raccoon.diagnose.drives.time_column import check_step
from raccoon.diagnose.recordings.kind import Kind
from raccoon.diagnose.recordings.rows.duration import limit_duration
from raccoon.diagnose.recordings.rows.interpolation import check_not_interpolated
from raccoon.diagnose.recordings.rows.repeated import (
    without_duplicate_times,
    without_empty_rows,
    without_held_rows,
)

Columns = Mapping[str, NDArray[np.float64]]


def select_rows(columns: Columns, kind: Kind) -> tuple[Columns, tuple[str, ...]]:
    """The columns in the rows that are used, and notes on the others.

    Raises TraceError for a drive in another unit of time, or with interpolated rows.
    """
    if kind is Kind.MOTORS:  # the motion of an axis in a pause is unknown
        return limit_duration(columns, shorten_pauses=False)
    if kind is not Kind.DRIVE:
        return columns, ()
    check_step(columns["t"])  # with a time in microseconds each row would follow a long pause
    check_not_interpolated(columns)
    columns, held_notes = without_held_rows(without_empty_rows(columns))
    columns, duration_notes = limit_duration(columns)
    return columns, (*held_notes, *duration_notes)


def select_unique_rows(columns: Columns, kind: Kind) -> tuple[Columns, tuple[str, ...]]:
    """`select_rows` after samples with duplicate times are removed."""
    columns, duplicate_notes = without_duplicate_times(columns)
    columns, notes = select_rows(columns, kind)
    return columns, (*duplicate_notes, *notes)


def select_unique_rows_of_each(
    recordings: Sequence[Columns], kind: Kind
) -> tuple[list[Columns], tuple[str, ...]]:
    """`select_unique_rows` for every recording after the first; notes and errors give its number."""
    selected, notes = [], []
    for number, each in enumerate(recordings, 1):
        with naming_recording(number):
            columns, row_notes = select_unique_rows(each, kind)
        selected.append(columns)
        notes += [f"recording {number + 1}: {note}" for note in row_notes]
    return selected, tuple(notes)
