"""Which rows of a recording are looked at: each once, and no more than can be simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.joined import said_of_recording
from raccoon.diagnose.drives.times import check_step
from raccoon.diagnose.recordings.kind import Kind
from raccoon.diagnose.recordings.rows.between import check_recorded
from raccoon.diagnose.recordings.rows.length import bounded
from raccoon.diagnose.recordings.rows.repeated import without_empty, without_held, without_repeated

Columns = Mapping[str, NDArray[np.float64]]


def rows_of(columns: Columns, kind: Kind) -> tuple[Columns, tuple[str, ...]]:
    """The columns of a recording of that kind in these rows, and what is to be said of the others.

    Raises TraceError for a drive in another unit of time, or between whose samples rows were interpolated.
    """
    if kind is Kind.MOTORS:  # whose motion in a pause is no more to be bridged than that of a drive
        return bounded(columns, pauses_too=False)
    if kind is not Kind.DRIVE:
        return columns, ()
    check_step(columns["t"])  # of a time in microseconds each row would come after a long pause
    check_recorded(columns)
    columns, held = without_held(without_empty(columns))
    columns, long = bounded(columns)
    return columns, (*held, *long)


def rows_of_other(columns: Columns, kind: Kind) -> tuple[Columns, tuple[str, ...]]:
    """The same of another recording, each row of it once."""
    columns, repeated = without_repeated(columns)
    columns, said = rows_of(columns, kind)
    return columns, (*repeated, *said)


def rows_of_others(every: Sequence[Columns], kind: Kind) -> tuple[list[Columns], tuple[str, ...]]:
    """The same of the recordings after the first, each said by its number, in errors as well."""
    found, notes = [], []
    for number, each in enumerate(every, 1):
        with said_of_recording(number):
            columns, said = rows_of_other(each, kind)
        found.append(columns)
        notes += [f"recording {number + 1}: {note}" for note in said]
    return found, tuple(notes)
