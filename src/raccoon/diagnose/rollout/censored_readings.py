"""Censoring of simulated back-EMF readings, for comparison with measured ones below a dead zone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.truncation import HALF_A_COUNT

Array = NDArray[np.float64]

MIN_ZONE_COUNTS = 2.0
"""Counts. Readings are whole numbers truncated towards 0: itself a zone of one count, from which none below
two can be distinguished."""
IMPOSSIBLE_READING_FACTOR = 10.0
"""Factor on the error of a reading that the zone would not let through, over any other error of as many
counts: it is no noise. At 1, beside twice the usual noise, zones came out at up to three times their size."""
FLICKER_WINDOW_ROWS, FLICKER_SILENT_SHARE = 20, 0.75
"""Rows to either side of a reading that flickers, and the share of them that must be silent."""


def censor_readings(
    samples: Array, zones: Array, measured: Array, flickers: NDArray[np.bool_], silent: float = 0.0
) -> Array:
    """Simulated readings (variants, rows) under dead zones (variants, 1), given what was measured (rows,).

    A reading of 0 says that the speed is inside the zone: the error is how far the simulated one is outside.
    One that is not 0 is compared as it is; if it is inside the zone, `IMPOSSIBLE_READING_FACTOR` times what
    it lacks to the zone's edge is added to its error, with half a count taken as truncated. (Up to a whole
    count may have been, but zones grow as far as they can: they would come out half a count too wide.) The
    error is continuous in the zone's width and where a wheel stops a moment earlier than simulated:
    thresholding the simulated reading itself cost a true zone of 14 counts 31 units of log evidence, where
    this gives it 95. A reading that is missing (NaN) says nothing.

    flickers (rows,): readings that noise lifted out of the zone amid silent ones. They are treated like
    silent ones: each is far from the speed, and always away from 0. Ten of 631 such made an offset of
    -8.0 +- 0.2 counts of one of -3.4.

    silent: counts up to which the true reading may be where 0 is read, since a filter in whole counts leaves
    0 later than it returns to it.
    """
    zones, found = (
        np.where(zones < MIN_ZONE_COUNTS, 0.0, zones).T,
        np.array(samples.T),
    )  # as they lie in memory
    impossible = (measured != 0.0) & ~flickers & (np.abs(measured) + HALF_A_COUNT < zones.max(initial=0.0))
    inside, quiet = np.flatnonzero(impossible), np.flatnonzero((measured == 0.0) | flickers)
    lacking = np.maximum(zones - np.abs(measured[inside, None]) - HALF_A_COUNT, 0.0)
    simulated, reading = found[quiet], measured[quiet, None]
    found[inside] += IMPOSSIBLE_READING_FACTOR * np.sign(measured[inside, None]) * lacking
    outside = np.maximum(np.abs(simulated) - np.maximum(zones, silent * (zones > 0.0)), 0.0)
    found[quiet] = np.where(
        (reading == 0.0) | (zones > 0.0), reading + np.copysign(outside, simulated), simulated
    )
    return found.T


def find_flickers(measured: Array) -> NDArray[np.bool_]:
    """Which readings (rows,) are not 0 where nearly all around them are."""
    known = np.isfinite(measured)
    window = np.ones(2 * FLICKER_WINDOW_ROWS + 1)
    silent = np.convolve(known & (measured == 0.0), window, "same")
    return np.asarray(
        known & (measured != 0.0) & (silent > FLICKER_SILENT_SHARE * np.convolve(known, window, "same"))
    )
