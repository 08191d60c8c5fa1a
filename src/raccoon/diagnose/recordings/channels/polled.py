"""A battery that a logger of one's own reads now and then, and writes into every row until the next time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]

OFTEN = 0.08
"""s between changes from which a reading is not read in every cycle: however stiff the battery, while wheels
speed up one change comes after the other."""
SOON = 5.0
"""Percentile of the times between changes that is compared with it."""
FEWEST, RARELY = 20, 1.5
"""Readings of a drive, and s between them, from which they say something of it."""


def without_held_voltage(name: str, time: Array, values: Array) -> tuple[Array, SensorFault | None]:
    """Only the rows in which a battery was read, and the fault where these are too few.

    Read each second, it was a load from 15 s on; each five seconds, a battery without a resistance beside a
    gear that loses torque, each with a probability of 1.
    """
    known = np.flatnonzero(np.isfinite(values))
    new = known[np.diff(values[known], prepend=np.nan) != 0.0]
    if len(new) < 2:
        return values, None
    between = np.diff(time[new])
    if float(np.percentile(between, SOON)) < OFTEN:
        return values, None
    usual = float(np.median(between))
    if len(new) < FEWEST or usual > RARELY:
        return values, SensorFault(
            name, "rare", f"{name} is new every {usual:.2g} s only: read it in every cycle"
        )
    found = np.full(len(values), np.nan)
    found[new] = values[new]
    return found, None
