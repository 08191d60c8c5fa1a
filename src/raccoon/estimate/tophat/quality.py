"""Checks of readings before surfaces are searched in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.errors import ConfigError
from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP
from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, Verdict
from raccoon.estimate.tophat.flicker import detect_flicker_hz
from raccoon.estimate.tophat.sequence import longest_above, noise_sd
from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

MIN_READINGS = 40  # 0.2 s at 200 Hz
MAX_AT_RAIL = 0.9
MAINS_READINGS = 10  # readings of a mean: whole periods of lamps on mains of 50 and of 60 Hz
MEANS_APART = 6  # readings between such means
RESTLESS_COUNTS = 10.0  # counts; random changes under a standing robot: below 5 when plugged in
FLICKER_REST_SHARE = 0.5
"""Share of the readings' standard deviation under lamps that such means may keep if words come unevenly."""
NO_LIGHT_COUNTS, DROWNED_COUNTS = 3900.0, 30.0
"""Counts: white at a height of 23 mm reads less than the first, and in the sun more than the second."""
NARROWEST = 0.010  # m; tapes are 12 mm and wider, and any seam appears at most 9 mm wide
WANDERING_COUNTS = 250.0  # counts between successive readings; no floor changes so much
PIECE_READINGS = 20  # readings: 0.1 s at 200 Hz, whole periods of lamps on mains of 50 and of 60 Hz
MOVED_LIGHT_SHARE = 0.15  # change of light, as a share, of a sensor that is held or shaded by a hand
NOISE_SDS = 6.0  # in standard deviations of the mean of a piece


def check_counts(samples: ArrayLike) -> Array:
    """The samples as floats, shape (n,).

    Raises ConfigError naming the first reading that is not a 12-bit count, or the shape that is not 1-D.
    """
    try:
        counts = np.asarray(samples, dtype=float)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"samples are not numbers: {error}") from None
    if counts.ndim != 1:
        raise ConfigError(f"samples have the shape {counts.shape}: allowed is one dimension")
    wrong = ~((counts >= 0.0) & (counts <= FULL_SCALE))  # also true for NaN
    if wrong.any():
        at = int(np.argmax(wrong))
        raise ConfigError(f"samples[{at}] = {counts[at]}: allowed are counts from 0 to {FULL_SCALE:.0f}")
    return counts


def find_refusal(counts: Array) -> TophatCalibration | None:
    """A refusal that needs no search for surfaces, or None."""
    if len(counts) < MIN_READINGS:
        return TophatCalibration(
            Verdict.TOO_FEW, f"{len(counts)} readings; at least {MIN_READINGS} are needed"
        )
    ends = (
        (counts <= ANALOG_BOTTOM, "bottom (wires that touch, or too much light)"),
        (counts >= ANALOG_TOP, "top (no light, or unplugged)"),
    )
    for there, name in ends:
        share = float(np.mean(there))
        if share >= MAX_AT_RAIL:
            return TophatCalibration(
                Verdict.SATURATED, f"{share:.0%} of the readings stand at the converter's {name}"
            )
    return None


def no_surfaces_calibration(counts: Array) -> TophatCalibration:
    """The calibration if no two surfaces were found. Readings that jump come from an open input."""
    if float(np.median(np.abs(np.diff(counts)))) > WANDERING_COUNTS:
        return TophatCalibration(Verdict.FLOATING, "the readings jump about as an open input does")
    mean, ask = float(counts.mean()), "drive over white and black"
    if mean > NO_LIGHT_COUNTS:
        ask = "the sensor was over black only, or is too high above the floor"
    elif mean < DROWNED_COUNTS:
        ask = "the light is too bright for the sensor: shade it"
    return TophatCalibration(
        Verdict.ONE_SURFACE, f"one surface at {mean:.0f} counts; {ask}", white=Surface.of(counts)
    )


def refuse_narrow(found: TophatCalibration, counts: Array, ways: ArrayLike) -> TophatCalibration:
    """The calibration, or its refusal if no dark part is as wide as a line. ways: see `cluster.calibrate`.

    Raises ConfigError for another number of ways than of counts.
    """
    steps = np.asarray(ways, dtype=float)
    if steps.shape != counts.shape:
        raise ConfigError(
            f"ways have the shape {steps.shape}: allowed is that of the samples, {counts.shape}"
        )
    if found.threshold is None:
        return found
    width = longest_above(counts, found.threshold, steps)
    if width >= NARROWEST:
        return found
    told = f"the darker part is {1000.0 * width:.0f} mm long, and lines are wider than"
    reason = f"{told} {1000.0 * NARROWEST:.0f} mm: a seam, or the light changed"
    return TophatCalibration(Verdict.ONE_SURFACE, reason, white=found.white)


def is_restless(standing: ArrayLike) -> bool:
    """Whether the readings of a standing robot wander as those of an open input do, which may follow its
    neighbour and so show white and black.

    Judged by second differences of short means: a passing shadow, light that changes evenly, and lamps that
    flicker are not wandering. False for too few readings.
    """
    counts = np.asarray(standing, dtype=float)
    if len(counts) < MIN_READINGS:
        return False
    means = np.convolve(counts, np.full(MAINS_READINGS, 1.0 / MAINS_READINGS), "valid")
    bends = means[2 * MEANS_APART :] - 2.0 * means[MEANS_APART:-MEANS_APART] + means[: -2 * MEANS_APART]
    limit = (
        max(RESTLESS_COUNTS, FLICKER_REST_SHARE * float(counts.std()))
        if detect_flicker_hz(counts)
        else RESTLESS_COUNTS
    )
    return float(np.median(np.abs(bends))) > limit


def was_moved(standing: ArrayLike) -> bool:
    """Whether a sensor read more than one place or light: it was moved, held or shaded meanwhile.

    standing: counts, in order of time. False for too few readings.
    """
    counts = np.asarray(standing, dtype=float)
    pieces = len(counts) // PIECE_READINGS
    if pieces < 2:
        return False
    means = counts[: pieces * PIECE_READINGS].reshape(pieces, PIECE_READINGS).mean(axis=1)
    least, most = float(means.min()), float(means.max())
    light = FULL_SCALE / max(least, 1.0) - FULL_SCALE / max(most, 1.0)
    noise = noise_sd(counts) / PIECE_READINGS**0.5
    return (
        light > MOVED_LIGHT_SHARE * (FULL_SCALE / max(least, 1.0) - 1.0) and most - least > NOISE_SDS * noise
    )
