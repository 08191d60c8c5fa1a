"""The calibration of one tophat: two surfaces, the threshold between them, and its reliability."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.errors import CalibrationError

CLEAR_SDS = 6.0  # standard deviations at which errors are negligible
MIN_SD = 1.0  # counts; lower bound, the converter's step and noise


class Verdict(StrEnum):
    """Result of a calibration. Only `ok` and `weak` have a threshold."""

    OK = "ok"
    WEAK = "weak"
    """Two surfaces, but the threshold may be several times worse than the best one, or white is at the
    converter's bottom."""
    ONE_SURFACE = "one_surface"
    TOO_FEW = "too_few"
    SATURATED = "saturated"
    """Nearly all readings are at an end of the converter's range."""
    FLOATING = "floating"
    """The input wanders like one with nothing connected."""

    @property
    def usable(self) -> bool:
        """Whether this verdict has a threshold."""
        return self in (Verdict.OK, Verdict.WEAK)


@dataclass(frozen=True, slots=True)
class Surface:
    """Readings over one surface: mean and standard deviation in counts, and their number."""

    mean: float
    sd: float
    count: int

    @classmethod
    def of(cls, counts: NDArray[np.float64]) -> Surface:
        """The surface that has all these readings."""
        return cls(float(counts.mean()), max(float(counts.std()), MIN_SD), len(counts))


@dataclass(frozen=True, slots=True)
class TophatCalibration:
    """Result of a calibration. Counts are 12-bit and higher on black.

    threshold, low, high: counts; a reading is black at or above `high`, white at or below `low`; between them
    the last answer stays.
    separation: (black - white) / (sd of white + sd of black). share_black: share of the readings on black,
    0..1.
    error_rate: expected share of wrong readings at `threshold`. reason: one sentence for people.
    flickers: Hz of the flickering light over which readings were averaged (100, 120; 0 for none); 250 if
    words that are renewed at this rate beat with the light.

    Without a second surface threshold, low, high, black and error_rate are None.
    """

    verdict: Verdict
    reason: str
    white: Surface | None = None
    black: Surface | None = None
    threshold: float | None = None
    low: float | None = None
    high: float | None = None
    separation: float = 0.0
    share_black: float = 0.0
    error_rate: float | None = None
    flickers: int = 0

    @property
    def usable(self) -> bool:
        """Whether there is a threshold."""
        return self.threshold is not None

    def probability_black(self, counts: ArrayLike) -> NDArray[np.float64]:
        """P(black | reading), same shape as `counts`: 0.5 at the threshold.

        From the odds of two normal densities (see `log_odds`); readings beyond a mean count as the mean.
        Raises CalibrationError without a threshold.
        """
        white, black = self.surfaces()
        threshold = white.mean if self.threshold is None else self.threshold
        inside = np.clip(np.asarray(counts, dtype=float), white.mean, black.mean)
        odds = log_odds(inside, white, black) - log_odds(threshold, white, black)
        return np.asarray(1.0 / (1.0 + np.exp(-np.clip(odds, -700.0, 700.0))))

    @classmethod
    def of_surfaces(
        cls, verdict: Verdict, reason: str, white: Surface, black: Surface, share_black: float
    ) -> TophatCalibration:
        """The calibration with these two surfaces, from which threshold, band and expected error follow."""
        threshold = half_covered_counts(white, black) or best_threshold(white, black)
        # The band contains the noise at the threshold, but leaves 60 % of the distance to each mean outside.
        low = max(threshold - 1.5 * white.sd, white.mean + 0.6 * (threshold - white.mean))
        high = min(threshold + 1.5 * black.sd, black.mean - 0.6 * (black.mean - threshold))
        missed = normal_tail((black.mean - threshold) / black.sd)
        false = normal_tail((threshold - white.mean) / white.sd)
        return cls(
            verdict=verdict,
            reason=reason,
            white=white,
            black=black,
            threshold=threshold,
            low=low,
            high=high,
            separation=(black.mean - white.mean) / (white.sd + black.sd),
            share_black=share_black,
            error_rate=0.5 * missed + 0.5 * false,
        )

    def surfaces(self) -> tuple[Surface, Surface]:
        """(white, black).

        Raises CalibrationError with the verdict if the calibration found no two surfaces.
        """
        if self.white is None or self.black is None or self.threshold is None:
            raise CalibrationError(f"the calibration has no threshold ({self.verdict}): {self.reason}")
        return self.white, self.black


Number = TypeVar("Number", float, NDArray[np.float64])


def log_odds(counts: Number, white: Surface, black: Surface) -> Number:
    """Log of (density over black / density over white) at readings between the two means.

    Beyond the means it would fall again if the standard deviations differ, so clip first. If the surfaces are
    far apart, readings between them come from edges and not from noise: each standard deviation counts as at
    least a twelfth of the contrast.
    """
    least = (black.mean - white.mean) / (2.0 * CLEAR_SDS)
    sd_white, sd_black = max(white.sd, least), max(black.sd, least)
    from_white, from_black = (counts - white.mean) / sd_white, (counts - black.mean) / sd_black
    return 0.5 * (from_white * from_white - from_black * from_black) + math.log(sd_white / sd_black)


def normal_tail(z: float) -> float:
    """P(N(0, 1) > z)."""
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def best_threshold(white: Surface, black: Surface) -> float:
    """Threshold (counts) with the least expected error between two normal densities, always between the
    means.

    It is where the densities cross: the root of a quadratic. With equal standard deviations it is the middle.
    """
    a = 1.0 / white.sd**2 - 1.0 / black.sd**2
    b = 2.0 * (black.mean / black.sd**2 - white.mean / white.sd**2)
    c = white.mean**2 / white.sd**2 - black.mean**2 / black.sd**2
    c -= 2.0 * math.log(black.sd / white.sd)
    gap = black.mean - white.mean
    balanced = white.mean + gap * white.sd / (white.sd + black.sd)
    if abs(a) * gap < 1e-9 * abs(b):
        root = -c / b
    else:
        under = b * b - 4.0 * a * c
        if under < 0.0:
            return balanced
        # the other root is beyond the mean of the narrower density
        root = (-b + math.sqrt(under)) / (2.0 * a)
    return root if white.mean < root < black.mean else balanced


def half_covered_counts(white: Surface, black: Surface) -> float | None:
    """Counts with half of the spot on black, moved as little as necessary to be clear of both surfaces.

    If the surfaces are far apart, every threshold between them is free of errors over a surface, but this one
    is right at an edge: light adds up over the spot, and counts are 4095 / (1 + light)
    (raccoon.model.reflectance). None if no threshold is clear of both.
    """
    clear_of_white, clear_of_black = white.mean + CLEAR_SDS * white.sd, black.mean - CLEAR_SDS * black.sd
    if not clear_of_white <= clear_of_black:
        return None
    half = 2.0 / (1.0 / max(white.mean, 1.0) + 1.0 / black.mean)
    return min(max(half, clear_of_white), clear_of_black)
