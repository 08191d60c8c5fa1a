"""Undoes, on average, the controller's truncation of back-EMF to whole counts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HALF_A_COUNT = 0.5


def undo_truncation(bemf: Array) -> Array:
    """Back-EMF (counts) with half a count added to its magnitude if it is in whole counts; otherwise
    unchanged. NaN stays NaN.

    Truncation moves a reading towards 0 by half a count on average, which is 0.3 % of a usual speed. Voltage
    and battery determine a reading's scale better than that: without the correction, 2 of 160 robots were
    reported a scale 0.5 % too small.
    """
    if np.any(np.nan_to_num(bemf) % 1.0):
        return bemf
    return np.asarray(bemf + HALF_A_COUNT * np.sign(bemf), float)
