"""Sorts the readings of a reflectance sensor into white and black levels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.noise import (
    MIN_READINGS,
    floor_pattern,
    median_std,
    noise_sd,
    sensor_noise,
)
from raccoon.diagnose.recordings.tophats.sorting import (
    MIN_CONTRAST,
    MIN_CONTRAST_SIGMAS,
    count_visits,
    is_off_edges,
    sort_by_threshold,
    two_means_threshold,
)
from raccoon.diagnose.result import ParameterResult
from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

TIME_PIECES = 10
"""Number of pieces of time, between which the levels may differ."""
MAX_NOISE = 50.0
"""Noise, counts, above which it does not come from the floor: `floor_pattern` is 20 at the most."""
MIN_CLIPPED_SHARE = 0.1
"""Share of a surface's readings at an end of the converter's range above which its level is clipped."""
MIN_LIMIT_RATIO = 3.0
"""Ratio of the share of black readings at the largest value to the share of white's most frequent value above
which black is clipped there."""
SENSOR_SPREAD = 4.0
"""Lower bound of the standard deviation between sound sensors of one make on the same floor, counts."""
MIN_VISITS = 3
"""Least number of visits to black without labels: a shadow falls on white once or twice, and its two levels
are not white and black."""


@dataclass(frozen=True, slots=True)
class SurfaceLevels:
    """Readings of one sensor sorted by surface.

    time, counts, black (n,): readings that are clearly on a surface. noise: standard deviation of a reading,
    counts. floor_pattern: part of it that may come from the floor, counts. piece (n,): index of each
    reading's piece of time. medians: counts over white and over black. clipped: for white and black, 1 if the
    level is clipped at the converter's largest value, -1 at 0, else 0. is_sorting_certain: a reference
    labelled white and black, or both were seen alternately.
    """

    time: Array
    counts: Array
    black: Flags
    noise: float
    piece: NDArray[np.intp]
    medians: tuple[float, float]
    clipped: tuple[int, int]
    is_sorting_certain: bool
    floor_pattern: float

    @property
    def unclipped_count(self) -> int:
        """Number of the two levels that are not clipped."""
        return self.clipped.count(0)

    def noise_number(self, assumed: float) -> ParameterResult:
        """The noise with its standard deviation: n steps between neighbours, of which any two adjacent ones
        share a reading, give it with a relative standard deviation of sqrt(3 / n) / 2."""
        fewest = float(min(self.black.sum(), (~self.black).sum()))
        std = float(max(0.5 * np.sqrt(3.0 / max(fewest, 1.0)), 0.02)) * self.noise
        return ParameterResult(self.noise, max(std, 0.5), "counts", assumed)

    def piece_levels(self, keep: Flags) -> Array:
        """Rows of (piece, black 0/1, level, std of the level), for pieces of time with enough readings."""
        rows = []
        for piece in range(TIME_PIECES):
            for black in (False, True):
                mine = keep & (self.piece == piece) & (self.black == black)
                if mine.sum() >= MIN_READINGS:
                    values = self.counts[mine]
                    rows.append((piece, float(black), float(np.median(values)), self._level_std(values)))
        return np.array(rows).reshape(-1, 4)

    def surface_levels(self, keep: Flags) -> Array:
        """Rows of (black 0/1, level, std of the level around that of a nominal sensor), which includes its
        own scatter and the differences between floors and between sensors."""
        rows = []
        for black in (False, True):
            values = self.counts[keep & (self.black == black)]
            level = float(np.median(values))
            std = np.hypot(np.hypot(self._level_std(values), SENSOR_SPREAD), floor_pattern(level))
            rows.append((float(black), level, float(std)))
        return np.array(rows)

    def _level_std(self, values: Array) -> float:
        return median_std(values, self.noise)


def sort_levels(time: Array, counts: Array, surface: Array | None) -> SurfaceLevels | str:
    """Sort the readings into levels; the reason as text if that is not possible.

    surface: 1 black, 0 white by a reference; without it the readings decide.
    """
    known = np.isfinite(counts)
    time, counts = time[known], counts[known]
    if len(counts) < 4 * MIN_READINGS:
        return f"it has {len(counts)} readings: at least {4 * MIN_READINGS} are needed"
    noise = noise_sd(np.diff(counts))
    pieces = time_pieces(time)
    if surface is not None:
        black = surface[known] > 0.5
        is_sure = is_off_edges(time, black)
    else:
        sorted_ = sort_by_threshold(counts, pieces, noise)
        if sorted_ is None:
            return _describe_single_surface(counts, noise)
        black, is_sure = sorted_
    if min((is_sure & black).sum(), (is_sure & ~black).sum()) < MIN_READINGS:
        return _describe_single_surface(counts, noise if surface is None else 0.0)
    medians, clipped = _medians_and_clipping(counts[is_sure], black[is_sure])
    # Edges are steps and not noise, and clipped readings show no noise.
    steady = is_sure & is_off_edges(time, black) & np.where(black, clipped[1] == 0, clipped[0] == 0)
    pairs = steady[1:] & steady[:-1] & (black[1:] == black[:-1])
    if pairs.sum() >= MIN_READINGS:
        noise = noise_sd(np.diff(counts)[pairs])
    sd, pattern = sensor_noise(np.diff(counts), pairs, black, medians, noise)
    contrast_std = (
        noise if surface is None else _contrast_std(counts[is_sure], black[is_sure], pieces[is_sure], noise)
    )
    if abs(medians[1] - medians[0]) < max(MIN_CONTRAST, MIN_CONTRAST_SIGMAS * contrast_std):
        hint = "; both are cut off: it is saturated" if 0 not in clipped else ""
        return f"white ({medians[0]:.0f}) and black ({medians[1]:.0f} counts) cannot be told apart{hint}"
    if limit := _describe_lower_limit(counts[is_sure], black[is_sure], clipped):
        return limit
    if medians[1] < medians[0]:
        return (
            f"black ({medians[1]:.0f}) reads lower than white ({medians[0]:.0f} counts), which no light, "
            "gain or height causes: the labels of black and white look swapped"
        )
    if 0 not in clipped:
        return f"white ({medians[0]:.0f}) and black ({medians[1]:.0f} counts) are both cut off"
    is_certain = surface is not None or count_visits(black[is_sure]) >= MIN_VISITS
    return SurfaceLevels(
        time[is_sure],
        counts[is_sure],
        black[is_sure],
        sd,
        pieces[is_sure],
        medians,
        clipped,
        is_certain,
        pattern,
    )


def level_pair(counts: Array, black: Flags | None) -> tuple[float, float] | None:
    """Median counts over white and black, sorted by `black` or else by the readings; None unless both are
    seen."""
    if black is not None:
        sides = counts[~black], counts[black]
        if min(map(len, sides)) < MIN_READINGS:
            return None
        return float(np.median(sides[0])), float(np.median(sides[1]))
    found = two_means_threshold(counts, noise_sd(np.diff(counts))) if len(counts) > 1 else None
    return None if found is None else (found[0], found[2])


def time_pieces(time: Array) -> NDArray[np.intp]:
    """Index of each reading's piece of time."""
    share = (time - time[0]) / max(float(np.ptp(time)), 1e-9)
    return np.asarray(np.minimum(share * TIME_PIECES, TIME_PIECES - 1), np.intp)


def _contrast_std(counts: Array, black: Flags, piece: NDArray[np.intp], noise: float) -> float:
    """Standard deviation of the contrast between labelled surfaces. It allows for readings that are
    individually not separable, and excludes changes of the levels by light from one piece of time to the
    next."""
    still = counts.astype(float)
    for index in np.unique(piece):
        for side in (False, True):
            mine = (piece == index) & (black == side)
            still[mine] -= np.median(still[mine]) if mine.any() else 0.0
    return float(np.hypot(median_std(still[black], noise), median_std(still[~black], noise)))


def _describe_single_surface(counts: Array, noise: float) -> str:
    """Text on why both surfaces were not found. noise: of readings without labels, counts; 0 with labels."""
    if noise >= MAX_NOISE:
        return (
            f"readings differ by {noise:.0f} counts from one to the next, which hides what is white and what "
            "black: check its plug and wires, and keep it from flickering lamps"
        )
    ends = float(((counts >= FULL_SCALE) | (counts <= 0.0)).mean())
    cut = (
        f" ({100 * ends:.0f} % of the readings are cut off: it may be saturated)"
        if ends >= MIN_CLIPPED_SHARE
        else ""
    )
    return f"only one surface was seen{cut}: drive over black and white"


def _describe_lower_limit(counts: Array, black: Flags, clipped: tuple[int, int]) -> str:
    """Text that black is clipped below the converter's largest value; "" if it is not. (Readings of a sensor
    without noise are also equal over white.)"""
    white, dark = counts[~black], counts[black]
    at_end = float((dark == counts.max()).mean())
    most_common_share = float(np.unique(white, return_counts=True)[1].max()) / len(white)
    if clipped[1] != 0 or at_end < MIN_CLIPPED_SHARE or at_end < MIN_LIMIT_RATIO * most_common_share:
        return ""
    return (
        f"it never reads more than {counts.max():g} counts, and exactly that in {100.0 * at_end:.0f} % of "
        "its readings over black: it is cut off there, below the converter's maximum; check its supply and "
        "what writes it"
    )


def _medians_and_clipping(counts: Array, black: Flags) -> tuple[tuple[float, float], tuple[int, int]]:
    """Median counts over white and over black, and whether each level is clipped (see `SurfaceLevels`)."""
    sides = counts[~black], counts[black]
    white, dark = (float(np.median(each)) for each in sides)
    clipped = [
        1
        if (each >= FULL_SCALE).mean() >= MIN_CLIPPED_SHARE
        else -1
        if (each <= 0.0).mean() >= MIN_CLIPPED_SHARE
        else 0
        for each in sides
    ]
    return (white, dark), (clipped[0], clipped[1])
