"""Calibration of a tophat that stands on one place of white and one of black, and the check that it stood
still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, Verdict
from raccoon.estimate.tophat.cluster import SURE_SEPARATION, calibrate_two_phase
from raccoon.estimate.tophat.levels import PATTERN_SHARE
from raccoon.estimate.tophat.quality import check_counts
from raccoon.estimate.tophat.sequence import noise_sd
from raccoon.model.reflectance import FULL_SCALE, light_of

PIECE_READINGS = 20  # readings: 0.1 s at 200 Hz, whole periods of lamps on mains of 50 and of 60 Hz
DOUBTFUL_BLACK_SHARE = 0.42
"""Share of white's light above which black is in nothing but the sun, or the sensor is half beside the
line."""
MOVED_LIGHT_SHARE = 0.15  # change of light, as a share, of a sensor that is held or shaded by a hand
NOISE_SDS = 6.0  # in standard deviations of the mean of a piece


def was_moved(standing: ArrayLike) -> bool:
    """Whether a sensor read more than one place or light: it was moved, held or shaded meanwhile.

    standing: counts, in order of time. False for too few readings.
    """
    counts = check_counts(standing)
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


def calibrate_standing(white: ArrayLike, black: ArrayLike) -> TophatCalibration:
    """`calibrate_two_phase` for a sensor that stood on one place of each.

    At rest it does not show how uneven floor and line are: their standard deviations are those of other
    floors. Raises ConfigError for values that are not counts.
    """
    found = calibrate_two_phase(white, black)
    if not found.usable:
        return found
    bright, dark = (_with_uneven_spread(each) for each in found.surfaces())
    wide = TophatCalibration.of_surfaces(found.verdict, found.reason, bright, dark, found.share_black)
    told = f"white reads {bright.mean:.0f} and black {dark.mean:.0f}"
    if wide.separation < SURE_SEPARATION:
        return replace(wide, verdict=Verdict.WEAK, reason=f"{told}, which is close")
    sent = light_of(dark.mean) / light_of(bright.mean)
    if sent > DOUBTFUL_BLACK_SHARE:
        told = f"{told}, {sent:.0%} of white's light: black in the sun, or the sensor is half beside the line"
        return replace(wide, verdict=Verdict.WEAK, reason=told)
    return wide if wide.verdict is Verdict.WEAK else replace(wide, reason=told)


def _with_uneven_spread(surface: Surface) -> Surface:
    pattern = PATTERN_SHARE * (surface.mean - surface.mean**2 / FULL_SCALE)
    return replace(surface, sd=float(np.hypot(surface.sd, pattern)))
