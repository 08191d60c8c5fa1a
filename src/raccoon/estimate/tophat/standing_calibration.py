"""Calibration of a tophat that stands on one place of white and one of black."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, Verdict
from raccoon.estimate.tophat.cluster import SURE_SEPARATION, calibrate_two_phase
from raccoon.estimate.tophat.levels import PATTERN_SHARE
from raccoon.model.reflectance import FULL_SCALE, light_of

DOUBTFUL_BLACK_SHARE = 0.42
"""Share of white's light above which black is in nothing but the sun, or the sensor is half beside the
line."""


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
