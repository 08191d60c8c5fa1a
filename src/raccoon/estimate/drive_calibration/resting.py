"""Back-EMF of a wheel that stands: its offset, and when it moves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import Measured

MIN_RESTING = 40
MOVING_COUNTS = 40.0
"""Back-EMF counts beyond the resting value that say a wheel moves."""


WORD_ERROR = 0.5
"""Counts by which whole words may all be off, as where a firmware cuts fractions instead of rounding them."""


def resting_offset(words: Sequence[float] | NDArray[np.float64], dead_zone: float) -> Measured | None:
    """The offset in counts, of readings at rest; None where there are fewer than 40.

    The board's filter makes neighbours alike: about one reading in nine is independent (0.2 at every step).
    Nothing but 0 from a device with a dead zone (counts) may be any offset within it, and so may what stands
    behind those readings of an offset at its edge that are 0.
    """
    if len(words) < MIN_RESTING:
        return None
    if dead_zone > 0.0 and not np.any(words):
        return Measured(0.0, dead_zone / math.sqrt(3.0))
    noise = max(float(np.std(words)), 0.5) / math.sqrt(len(words) / 9.0)
    hidden = dead_zone * (1.0 - np.count_nonzero(words) / len(words))
    return Measured(float(np.mean(words)), math.hypot(noise, WORD_ERROR, hidden))
