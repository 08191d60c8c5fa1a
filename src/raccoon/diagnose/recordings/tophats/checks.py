"""Readings of a tophat that are none of a converter's counts: impossible ones, and those of fewer bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.fit import FITS, Nominal, level_fits
from raccoon.diagnose.recordings.tophats.levels import Levels
from raccoon.diagnose.result import SensorFault
from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

BITS = 12


def possible(counts: Array, port: int) -> tuple[Array, tuple[SensorFault, ...]]:
    """Readings that the converter can give, NaN for the others, and what is said of those."""
    wild = (counts < 0.0) | (counts > FULL_SCALE)
    if not wild.any():
        return counts, ()
    name = f"analog.{port}"
    text = f"{name} has {int(wild.sum())} impossible values such as {float(counts[wild][0]):.3g}: left out"
    return np.where(wild, np.nan, counts), (SensorFault(name, "impossible", text),)


def fewer_bits(levels: Levels, nominal: Nominal) -> int:
    """10 or 8 where the levels are as assumed once they are that much larger, as those of KIPR's analog10()
    and analog8() are; else 0."""
    if levels.cut != (0, 0):
        return 0
    table = levels.both(np.ones(len(levels.time), np.bool_))
    for bits in (10, 8):
        times = 2.0 ** (BITS - bits)
        if levels.counts.max() >= 2.0**bits:
            continue
        if level_fits(table * np.array([1.0, times, times]), nominal)[0].misfit <= FITS:
            return bits
    return 0
