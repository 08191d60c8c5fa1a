"""Simulated readings of back-EMF as they are compared with measured ones that a dead zone cuts off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.truncation import HALF_A_COUNT

Array = NDArray[np.float64]

MIN_ZONE_COUNTS = 2.0
"""Counts. Readings are whole numbers cut towards 0: a zone of one count in itself, and none below two can be
told from it."""
IMPOSSIBLE_READING_FACTOR = 10.0
"""By how much more a reading counts that no such zone lets through than another error of as many counts: it
is no noise. At 1, beside twice the usual noise, zones came out at up to three times their size."""
FLICKER_WINDOW_ROWS, FLICKER_SILENT_SHARE = 20, 0.75
"""Rows to either side of a reading that flickers, and the part of them that is silent."""


def censor_readings(
    samples: Array, zones: Array, measured: Array, flickers: NDArray[np.bool_], silent: float = 0.0
) -> Array:
    """Simulated readings (variants, rows) under dead zones (variants, 1), given what was measured (rows,).

    A reading of 0 says that the speed is inside the zone: the simulated one is wrong by as much as it is
    outside. One that is not 0 is compared as it is, and is wrong by `IMPOSSIBLE_READING_FACTOR` times what
    it lacks to have been heard at all, half a count of which was cut off. (Up to a whole one may have been,
    but zones go as far as they are let: they would come out half a count too wide.) Nothing jumps, neither
    over the zone's width nor where a wheel stops a moment earlier than simulated: thresholding the
    simulated reading itself cost a true zone of 14 counts 31 units of log evidence, where this gives it 95.
    A reading that is missing (NaN) says nothing.

    flickers (rows,): readings that noise lifted out of the zone in the midst of silent ones. They say what a
    silent one says: each is far from the speed, and always away from 0. Ten of 631 such made an offset of
    -8.0 +- 0.2 counts of one of -3.4.

    silent: counts up to which a reading of 0 may be, where a filter in whole counts leaves 0 later than it
    comes back to it.
    """
    zones, found = (
        np.where(zones < MIN_ZONE_COUNTS, 0.0, zones).T,
        np.array(samples.T),
    )  # as they lie in memory
    soft = (measured != 0.0) & ~flickers & (np.abs(measured) + HALF_A_COUNT < zones.max(initial=0.0))
    cut, quiet = np.flatnonzero(soft), np.flatnonzero((measured == 0.0) | flickers)
    lacking = np.maximum(zones - np.abs(measured[cut, None]) - HALF_A_COUNT, 0.0)
    own, said = found[quiet], measured[quiet, None]
    found[cut] += IMPOSSIBLE_READING_FACTOR * np.sign(measured[cut, None]) * lacking
    outside = np.maximum(np.abs(own) - np.maximum(zones, silent * (zones > 0.0)), 0.0)
    found[quiet] = np.where((said == 0.0) | (zones > 0.0), said + np.copysign(outside, own), own)
    return found.T


def find_flickers(measured: Array) -> NDArray[np.bool_]:
    """Which readings (rows,) are not 0 where nearly all around them are."""
    known = np.isfinite(measured)
    window = np.ones(2 * FLICKER_WINDOW_ROWS + 1)
    silent = np.convolve(known & (measured == 0.0), window, "same")
    return np.asarray(
        known & (measured != 0.0) & (silent > FLICKER_SILENT_SHARE * np.convolve(known, window, "same"))
    )
