"""What a calibration of one tophat is: two surfaces, the threshold between them, and how far to trust it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.errors import CalibrationError

CLEAR_SDS = 6.0  # standard deviations that leave no error worth counting
MIN_SD = 1.0  # counts; no reading is better known than the converter's step and its noise


class Verdict(StrEnum):
    """What the readings allow. A threshold exists for `ok` and `weak` alone."""

    OK = "ok"
    WEAK = "weak"
    """Two surfaces, but the threshold may be several times worse than the best one, or white stands at the
    converter's bottom."""
    ONE_SURFACE = "one_surface"
    TOO_FEW = "too_few"
    SATURATED = "saturated"
    """Nearly all readings stand at an end of the converter."""
    FLOATING = "floating"
    """The input wanders as one does to which nothing is connected."""

    @property
    def usable(self) -> bool:
        """A threshold comes with this verdict."""
        return self in (Verdict.OK, Verdict.WEAK)


@dataclass(frozen=True, slots=True)
class Surface:
    """Readings over one surface: mean and standard deviation, counts; count: how many there were."""

    mean: float
    sd: float
    count: int

    @classmethod
    def of(cls, counts: NDArray[np.float64]) -> Surface:
        """The one that all these readings come from."""
        return cls(float(counts.mean()), max(float(counts.std()), MIN_SD), len(counts))


@dataclass(frozen=True, slots=True)
class TophatCalibration:
    """Result of a calibration. Counts are 12-bit and higher on black.

    threshold, low, high: counts; at or above `high` a reading is black, at or below `low` white, between them
    the last answer stands. separation: (black - white) / (sd of white + sd of black). share_black: of the
    readings, 0..1. error_rate: expected share of wrong readings at `threshold`. reason: one sentence for
    people. flickers: Hz at which the light did (100, 120; else 0), over which readings were averaged; 250
    where it did and words that come so often beat with it. Without a second surface threshold, low, high,
    black and error_rate are None.
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
        """There is a threshold."""
        return self.threshold is not None

    def probability_black(self, counts: ArrayLike) -> NDArray[np.float64]:
        """P(black | reading), same shape as `counts`: 0.5 at the threshold.

        The odds of two normal densities (see `log_odds`), whatever the reading.

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
        """The calibration of these two surfaces: threshold, band and expected error follow from them."""
        threshold = half_covered_counts(white, black) or best_threshold(white, black)
        # The band holds the noise at the threshold, but leaves 60 % of the way to each mean outside of it.
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

        Raises CalibrationError with the verdict where the calibration found no two surfaces.
        """
        if self.white is None or self.black is None or self.threshold is None:
            raise CalibrationError(f"the calibration has no threshold ({self.verdict}): {self.reason}")
        return self.white, self.black


Number = TypeVar("Number", float, NDArray[np.float64])


def log_odds(counts: Number, white: Surface, black: Surface) -> Number:
    """Log of (density over black / density over white) at readings between the two means.

    Beyond them it would fall again where the spreads differ, so clip first. Where the surfaces are far apart
    what lies between is an edge, no noise: each spread counts as at least a twelfth of the contrast.
    """
    least = (black.mean - white.mean) / (2.0 * CLEAR_SDS)
    sd_white, sd_black = max(white.sd, least), max(black.sd, least)
    from_white, from_black = (counts - white.mean) / sd_white, (counts - black.mean) / sd_black
    return 0.5 * (from_white * from_white - from_black * from_black) + math.log(sd_white / sd_black)


def normal_tail(z: float) -> float:
    """P(N(0, 1) > z)."""
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def best_threshold(white: Surface, black: Surface) -> float:
    """Counts of the least expected error between two normal densities, always between the means.

    Where the densities cross: a quadratic in the reading. With equal spreads it is the middle.
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
        root = (-b + math.sqrt(under)) / (2.0 * a)  # the other one lies beyond the mean of the narrower
    return root if white.mean < root < black.mean else balanced


def half_covered_counts(white: Surface, black: Surface) -> float | None:
    """Counts where half of the spot is on black, moved as little as keeps it clear of both surfaces.

    Where the surfaces are far apart every threshold between them has no error over a surface, but at an edge
    this one is right: light adds up over the spot, and counts are 4095 / (1 + light)
    (raccoon.model.reflectance). None where no threshold is clear of both.
    """
    clear_of_white, clear_of_black = white.mean + CLEAR_SDS * white.sd, black.mean - CLEAR_SDS * black.sd
    if not clear_of_white <= clear_of_black:
        return None
    half = 2.0 / (1.0 / max(white.mean, 1.0) + 1.0 / black.mean)
    return min(max(half, clear_of_white), clear_of_black)
