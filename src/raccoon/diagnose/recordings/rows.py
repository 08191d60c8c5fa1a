"""Which rows of a recording are looked at: each once, and no more than can be simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.length import bounded
from raccoon.diagnose.recordings.repeated import without_held, without_repeated
from raccoon.trace.recording import check_lengths

Columns = Mapping[str, NDArray[np.float64]]


DRIVE, MOTORS = "drive", "motors"


def check_rows(columns: Columns) -> None:
    """Raise TraceError for a recording without samples, and where a column is not as long as t."""
    if "t" not in columns or len(columns["t"]) == 0:
        raise TraceError("the recording is empty: it has no samples with a time t")
    check_lengths(columns)


def rows_of(columns: Columns, kind: str) -> tuple[Columns, tuple[str, ...]]:
    """The columns of a recording of that `Kind` in these rows, and what is to be said of the others."""
    if kind == MOTORS:  # whose motion in a pause is no more to be bridged than that of a drive
        return bounded(columns, pauses_too=False)
    if kind != DRIVE:
        return columns, ()
    columns, held = without_held(columns)
    columns, long = bounded(columns)
    return columns, (*held, *long)


def rows_of_others(every: Sequence[Columns], kind: str, name: str) -> tuple[list[Columns], tuple[str, ...]]:
    """The same of other recordings. name: what each is called, with its number as {}; the first is 2."""
    found, notes = [], []
    for number, each in enumerate(every, 2):
        columns, said = rows_of(without_repeated(each)[0], kind)
        found.append(columns)
        notes += [f"{name.format(number)}: {note}" for note in said]
    return found, tuple(notes)
