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
"""Pieces of time in which the levels may differ."""
MAX_NOISE = 50.0
"""Noise, counts, that no floor makes: `floor_pattern` is 20 at the most."""
MIN_CLIPPED_SHARE = 0.1
"""Share of a surface's readings at an end of the converter's range from which its level is clipped."""
MIN_LIMIT_RATIO = 3.0
"""Share of black readings at the largest value over that of white's most frequent value, from which black is
clipped there."""
SENSOR_SPREAD = 4.0
"""Counts; least standard deviation between sound sensors of one make on the same floor."""
MIN_VISITS = 3
"""Visits to black that are needed where no reference labels it: a shadow falls on white once or twice, and
its two levels are not white and black."""


@dataclass(frozen=True, slots=True)
class SurfaceLevels:
    """Readings of one sensor sorted by surface.

    time, counts, black (n,): the readings that are clearly on a surface. noise: counts, sd of a reading.
    floor_pattern: counts, how much of that the floor itself may make. piece (n,): piece of time of each.
    medians: counts over white and over black. clipped: for white and black, 1 where the level is clipped at
    the converter's largest value, -1 at 0, else 0. is_sorting_certain: a reference labelled white and black,
    or both were seen in turns.
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
        """How many of the two levels are not clipped."""
        return self.clipped.count(0)

    def noise_number(self, assumed: float) -> ParameterResult:
        """The noise with its standard deviation: n steps between neighbours, of which each two have a reading
        in common, give it to sqrt(3 / n) / 2 of itself."""
        fewest = float(min(self.black.sum(), (~self.black).sum()))
        std = float(max(0.5 * np.sqrt(3.0 / max(fewest, 1.0)), 0.02)) * self.noise
        return ParameterResult(self.noise, max(std, 0.5), "counts", assumed)

    def piece_levels(self, keep: Flags) -> Array:
        """Rows of piece, black 0/1, level and its std, for pieces of time with enough readings."""
        rows = []
        for piece in range(TIME_PIECES):
            for black in (False, True):
                mine = keep & (self.piece == piece) & (self.black == black)
                if mine.sum() >= MIN_READINGS:
                    values = self.counts[mine]
                    rows.append((piece, float(black), float(np.median(values)), self._level_std(values)))
        return np.array(rows).reshape(-1, 4)

    def surface_levels(self, keep: Flags) -> Array:
        """Rows of black 0/1, level, and its std around that of a nominal sensor: from its own spread, and
        from differences between floors and between sensors."""
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
    """Sort the readings into levels; where that cannot be done, the reason as text.

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
    # Edges are steps, not noise, and clipped readings have no noise.
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
    """Median counts over white and black, by `black` or else by the readings; None where not both are
    seen."""
    if black is not None:
        sides = counts[~black], counts[black]
        if min(map(len, sides)) < MIN_READINGS:
            return None
        return float(np.median(sides[0])), float(np.median(sides[1]))
    found = two_means_threshold(counts, noise_sd(np.diff(counts))) if len(counts) > 1 else None
    return None if found is None else (found[0], found[2])


def time_pieces(time: Array) -> NDArray[np.intp]:
    """Piece of time of each reading."""
    share = (time - time[0]) / max(float(np.ptp(time)), 1e-9)
    return np.asarray(np.minimum(share * TIME_PIECES, TIME_PIECES - 1), np.intp)


def _contrast_std(counts: Array, black: Flags, piece: NDArray[np.intp], noise: float) -> float:
    """Standard deviation of the contrast between labelled surfaces. Single readings need not tell these
    apart, and light that changes the levels from one piece of time to the next does not hide their
    contrast."""
    still = counts.astype(float)
    for index in np.unique(piece):
        for side in (False, True):
            mine = (piece == index) & (black == side)
            still[mine] -= np.median(still[mine]) if mine.any() else 0.0
    return float(np.hypot(median_std(still[black], noise), median_std(still[~black], noise)))


def _describe_single_surface(counts: Array, noise: float) -> str:
    """Why surfaces were not found. noise: counts, of readings without labels; 0 with labels."""
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
    """That black is clipped below the converter's largest value; "" where it is not. Readings of a sensor
    without noise are equal over white as well."""
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
