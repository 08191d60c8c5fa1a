"""A battery's voltage that a logger samples now and then and holds in every row until the next sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]

MAX_CYCLE_S = 0.08
"""s between changes above which a reading is held: read in every cycle, even a stiff battery's changes from
cycle to cycle while wheels accelerate."""
CHANGE_PERCENTILE = 5.0
"""Percentile of the times between changes that is compared with `MAX_CYCLE_S`."""
MIN_READINGS, MAX_READING_PERIOD_S = 20, 1.5
"""Readings that a drive needs, and longest s between them, to be of use."""


def without_held_voltages(name: str, time: Array, values: Array) -> tuple[Array, SensorFault | None]:
    """The values with NaN where they are held, and the fault where the readings are too few.

    Held for a second each, they were taken for a load from 15 s on; held for five, for a battery without
    resistance and a gear that loses torque, each with a probability of 1.
    """
    known = np.flatnonzero(np.isfinite(values))
    new = known[np.diff(values[known], prepend=np.nan) != 0.0]
    if len(new) < 2:
        return values, None
    between = np.diff(time[new])
    if float(np.percentile(between, CHANGE_PERCENTILE)) < MAX_CYCLE_S:
        return values, None
    period = float(np.median(between))
    if len(new) < MIN_READINGS or period > MAX_READING_PERIOD_S:
        return values, SensorFault(
            name, "rare", f"{name} changes every {period:.2g} s only: read it in every cycle"
        )
    readings = np.full(len(values), np.nan)
    readings[new] = values[new]
    return readings, None
