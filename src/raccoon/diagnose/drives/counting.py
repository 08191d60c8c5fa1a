"""The error of readings that count whole ticks."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SAME_VALUE_TOLERANCE = 1e-6
"""Relative difference of two readings up to which they are one value with rounding errors."""


def counting_error(values: Array) -> float:
    """Standard deviation of a row's reading due to counting whole ticks, in the reading's unit: both ends of
    the row are truncated. values: the reading's, NaN where there is none."""
    known = values[np.isfinite(values)]
    level_steps = np.diff(np.unique(known))
    level_steps = level_steps[level_steps > SAME_VALUE_TOLERANCE * np.abs(known).max(initial=0.0)]
    return float(np.percentile(level_steps, 10.0)) / math.sqrt(6.0) if len(level_steps) else 0.0
