"""Samples that a recorder wrote twice."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Columns = Mapping[str, NDArray[np.float64]]

MOST_REPEATED = 0.1
"""Share of the samples. More are no slip of a recorder, and are left to be refused."""


def without_repeated(columns: Columns) -> tuple[Columns, tuple[str, ...]]:
    """The columns without samples whose time is that of the one before, and what is to be said of it."""
    time = columns.get("t", np.zeros(0))
    again = np.flatnonzero(np.diff(time) == 0.0) + 1
    if len(again) == 0 or len(again) > MOST_REPEATED * len(time):
        return columns, ()
    one = len(again) == 1
    said = (
        f"{len(again)} {'sample has' if one else 'samples have'} the time of the one before and "
        f"{'is' if one else 'are'} left out: the first at {time[again[0]]:.6g} s, row {again[0]}"
    )
    return {name: np.delete(each, again) for name, each in columns.items()}, (said,)
