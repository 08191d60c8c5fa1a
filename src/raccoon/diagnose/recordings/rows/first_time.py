"""Counts the times of a recording from its first row, if its clock counts from 1970."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Columns = Mapping[str, NDArray[np.float64]]

MIN_DATE_S = 1e8
"""Time of the first row in s from which it is a date: three years. A clock that counts from when the
controller was switched on, or from midnight, stays below."""


def with_times_from_first_row(columns: Columns) -> tuple[Columns, tuple[str, ...]]:
    """The columns with times from the first row on, and a note on this, if the time is a date.

    A report has times with a tenth of a second, which nobody finds in a plot or in a video of the drive as
    seconds since 1970. A time that is not finite or goes back stays, since an error will name it.
    """
    time = columns.get("t", np.zeros(0))
    if len(time) == 0 or not time[0] >= MIN_DATE_S or not (np.diff(time) >= 0.0).all():
        return columns, ()
    note = f"all times are from the first row on, whose t is {time[0]:.3f} s"
    return {**columns, "t": time - time[0]}, (note,)
