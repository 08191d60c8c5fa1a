"""Back-EMF of a wheel at rest: its offset, and the threshold of motion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import Measured

MIN_RESTING = 40
MOVING_COUNTS = 40.0
"""Back-EMF counts beyond the resting value above which a wheel moves."""


WORD_ERROR = 0.5
"""Counts by which all whole words may be off, as with a firmware that cuts fractions instead of rounding."""


def resting_offset(words: Sequence[float] | NDArray[np.float64], dead_zone: float) -> Measured | None:
    """The offset in counts from readings at rest; None for fewer than 40.

    The board's filter correlates neighbours: about one reading in nine is independent (0.2 at every step). If
    a device with a dead zone (counts) reads only 0, the offset may be anywhere within it; if an offset at its
    edge makes some readings 0, their hidden values may be, too.
    """
    if len(words) < MIN_RESTING:
        return None
    if dead_zone > 0.0 and not np.any(words):
        return Measured(0.0, dead_zone / math.sqrt(3.0))
    noise = max(float(np.std(words)), 0.5) / math.sqrt(len(words) / 9.0)
    hidden = dead_zone * (1.0 - np.count_nonzero(words) / len(words))
    return Measured(float(np.mean(words)), math.hypot(noise, WORD_ERROR, hidden))
