"""Battery voltages that a logger samples rarely and holds in every row until the next sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]

MAX_CYCLE_S = 0.08
"""Time between changes, s, above which a reading is held: if it is read in every cycle, even a stiff
battery's changes from cycle to cycle while wheels accelerate."""
CHANGE_PERCENTILE = 5.0
"""Percentile of the times between changes that is compared with `MAX_CYCLE_S`."""
MIN_READINGS, MAX_READING_PERIOD_S = 20, 1.5
"""Least number of readings, and longest time between them, s, for a useful channel."""


def without_held_voltages(name: str, time: Array, values: Array) -> tuple[Array, SensorFault | None]:
    """The values with NaN where they are held, and a fault if there are too few readings.

    Voltages held for a second were diagnosed as a load from 15 s on; voltages held for five, as a battery
    without resistance and a gear that loses torque, each with a probability of 1.
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
