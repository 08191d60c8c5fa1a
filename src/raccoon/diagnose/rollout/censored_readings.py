"""Censoring of simulated back-EMF readings, for comparison with measured ones below a dead zone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.truncation import HALF_A_COUNT

Array = NDArray[np.float64]

MIN_ZONE_COUNTS = 2.0
"""Counts. Readings are truncated to whole numbers towards 0, which acts like a zone of one count, so no zone
below two can be detected."""
IMPOSSIBLE_READING_FACTOR = 10.0
"""Weight of the error of a reading that the zone would not pass, relative to any other error of as many
counts: it cannot be noise. With 1, under twice the usual noise, zones came out at up to three times their
size."""
FLICKER_WINDOW_ROWS, FLICKER_SILENT_SHARE = 20, 0.75
"""Rows to either side of a flickering reading, and the share of them that must be 0."""


def censor_readings(
    samples: Array, zones: Array, measured: Array, flickers: NDArray[np.bool_], silent: float = 0.0
) -> Array:
    """Simulated readings (variants, rows) under dead zones (variants, 1), for comparison with measured ones
    (rows,).

    A reading of 0 means that the speed is inside the zone: the error is the distance of the simulated reading
    from the zone. A reading other than 0 is compared as it is; if it is inside the zone,
    `IMPOSSIBLE_READING_FACTOR` times its distance to the zone's edge is added to its error, with an allowance
    of half a count for truncation. (Up to a whole count may have been truncated, but zones grow as far as
    they can and would come out half a count too wide.) The error is continuous in the zone's width, and also
    if a wheel stops a moment earlier than simulated: thresholding the simulated reading itself lost 31 of log
    evidence at a true zone of 14 counts, where this gains 95. A missing reading (NaN) has no effect.

    flickers (rows,): single readings that noise lifted out of the zone among readings of 0. They are treated
    like these: each is far from the speed, and always away from 0. Ten of 631 such made an offset of -8.0 +-
    0.2 counts of one of -3.4.

    silent: largest true reading (counts) for which 0 may be read, since a filter in whole counts leaves 0
    later than it returns to it.
    """
    zones, found = (
        np.where(zones < MIN_ZONE_COUNTS, 0.0, zones).T,
        np.array(samples.T),
    )  # in memory order
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
    """Which readings (rows,) are not 0 although nearly all around them are."""
    known = np.isfinite(measured)
    window = np.ones(2 * FLICKER_WINDOW_ROWS + 1)
    silent = np.convolve(known & (measured == 0.0), window, "same")
    return np.asarray(
        known & (measured != 0.0) & (silent > FLICKER_SILENT_SHARE * np.convolve(known, window, "same"))
    )
