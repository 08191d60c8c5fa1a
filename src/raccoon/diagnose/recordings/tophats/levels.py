"""What a reflectance sensor read over white and over black, piece of time by piece of time."""

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
"""Of time, in which the levels may differ."""
MAX_NOISE = 50.0
"""Counts from reading to reading that no floor makes: `floor_pattern` is 20 at the most."""
MIN_CLIPPED_SHARE = 0.1
"""Share of a surface's readings at the end of the converter from which its level is cut off."""
MIN_LIMIT_RATIO = 3.0
"""Times as often black must read the one largest value as white reads any, where that is cut off."""
SENSOR_SPREAD = 4.0
"""Counts by which two sound sensors of one make differ on the same floor at the least."""
MIN_VISITS = 3
"""How often black must have been seen, where no reference says what is black: a shadow over white falls once
or twice, and its two levels are those of no sensor."""


@dataclass(frozen=True, slots=True)
class SurfaceLevels:
    """Readings of one sensor sorted by surface.

    time, counts, black (n,): the readings that lie clearly on a surface. noise: counts, sd of a reading.
    pattern: counts, how much of that the floor itself may make. piece (n,): piece of time of each. usual:
    counts, white and black over all. cut: for white and black, 1 where the level is cut off at the
    converter's largest value, -1 at 0, else 0. sorted_surely: a reference told white from black, or both
    were seen in turns.
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
        """How many of the two levels were read as they are."""
        return self.clipped.count(0)

    def noise_number(self, assumed: float) -> ParameterResult:
        """The noise with its deviation: n steps between neighbours, each two of which have a reading in
        common, tell it to sqrt(3 / n) / 2 of itself."""
        fewest = float(min(self.black.sum(), (~self.black).sum()))
        std = float(max(0.5 * np.sqrt(3.0 / max(fewest, 1.0)), 0.02)) * self.noise
        return ParameterResult(self.noise, max(std, 0.5), "counts", assumed)

    def piece_levels(self, keep: Flags) -> Array:
        """Rows of piece, black 0/1, level, its deviation, for pieces with enough readings."""
        rows = []
        for piece in range(TIME_PIECES):
            for black in (False, True):
                mine = keep & (self.piece == piece) & (self.black == black)
                if mine.sum() >= MIN_READINGS:
                    values = self.counts[mine]
                    rows.append((piece, float(black), float(np.median(values)), self._level_std(values)))
        return np.array(rows).reshape(-1, 4)

    def surface_levels(self, keep: Flags) -> Array:
        """Rows of black 0/1, level, and by how much a sound sensor's may be off: by its own spread, and since
        no two floors and no two sensors are alike."""
        rows = []
        for black in (False, True):
            values = self.counts[keep & (self.black == black)]
            level = float(np.median(values))
            off = np.hypot(np.hypot(self._level_std(values), SENSOR_SPREAD), floor_pattern(level))
            rows.append((float(black), level, float(off)))
        return np.array(rows)

    def _level_std(self, values: Array) -> float:
        return median_std(values, self.noise)


def sort_levels(time: Array, counts: Array, surface: Array | None) -> SurfaceLevels | str:
    """Sort the readings. surface: 1 black, 0 white where a reference says so, else the readings decide.

    Gives the reason as text where it cannot be done.
    """
    known = np.isfinite(counts)
    time, counts = time[known], counts[known]
    if len(counts) < 4 * MIN_READINGS:
        return f"it has {len(counts)} readings: at least {4 * MIN_READINGS} are needed"
    noise = noise_sd(np.diff(counts))
    piece = time_pieces(time)
    if surface is not None:
        black = surface[known] > 0.5
        sure = is_off_edges(time, black)
    else:
        sorted_ = sort_by_threshold(counts, piece, noise)
        if sorted_ is None:
            return _describe_single_surface(counts, noise)
        black, sure = sorted_
    if min((sure & black).sum(), (sure & ~black).sum()) < MIN_READINGS:
        return _describe_single_surface(counts, noise if surface is None else 0.0)
    medians, clipped = _medians_and_clipping(counts[sure], black[sure])
    # Edges are steps, not noise; and what is cut off has none.
    steady = sure & is_off_edges(time, black) & np.where(black, clipped[1] == 0, clipped[0] == 0)
    pairs = steady[1:] & steady[:-1] & (black[1:] == black[:-1])
    if pairs.sum() >= MIN_READINGS:
        noise = noise_sd(np.diff(counts)[pairs])
    sd, floor_pattern = sensor_noise(np.diff(counts), pairs, black, medians, noise)
    contrast_std = noise if surface is None else _contrast_std(counts[sure], black[sure], piece[sure], noise)
    if abs(medians[1] - medians[0]) < max(MIN_CONTRAST, MIN_CONTRAST_SIGMAS * contrast_std):
        end = "; both are cut off: it is saturated" if 0 not in clipped else ""
        return f"white ({medians[0]:.0f}) and black ({medians[1]:.0f} counts) cannot be told apart{end}"
    if limit := _describe_lower_limit(counts[sure], black[sure], clipped):
        return limit
    if medians[1] < medians[0]:
        return (
            f"black ({medians[1]:.0f}) reads lower than white ({medians[0]:.0f} counts), which no light, "
            "gain or height does: the labels of black and white look swapped"
        )
    if 0 not in clipped:
        return f"white ({medians[0]:.0f}) and black ({medians[1]:.0f} counts) are both cut off"
    is_certain = surface is not None or count_visits(black[sure]) >= MIN_VISITS
    return SurfaceLevels(
        time[sure],
        counts[sure],
        black[sure],
        sd,
        piece[sure],
        medians,
        clipped,
        is_certain,
        floor_pattern,
    )


def level_pair(counts: Array, black: Flags | None) -> tuple[float, float] | None:
    """Levels of white and of black, by `black` or else by the readings; None where not both are seen."""
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
    """Deviation of the contrast where a reference says what is black: then single readings need not tell, and
    light that changes the levels from one piece of time to another hides no contrast."""
    still = counts.astype(float)
    for index in np.unique(piece):
        for side in (False, True):
            mine = (piece == index) & (black == side)
            still[mine] -= np.median(still[mine]) if mine.any() else 0.0
    return float(np.hypot(median_std(still[black], noise), median_std(still[~black], noise)))


def _describe_single_surface(counts: Array, noise: float) -> str:
    """Why nothing is told. noise: counts, of readings that had to tell the surfaces themselves."""
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
    """That black is cut off below the converter's largest value; "" where it is not. A sensor so quiet that
    its readings are alike is it over white as well."""
    white, dark = counts[~black], counts[black]
    at_end = float((dark == counts.max()).mean())
    most_common_share = float(np.unique(white, return_counts=True)[1].max()) / len(white)
    if clipped[1] != 0 or at_end < MIN_CLIPPED_SHARE or at_end < MIN_LIMIT_RATIO * most_common_share:
        return ""
    return (
        f"it never reads more than {counts.max():g} counts, as in {100.0 * at_end:.0f} % of what it reads "
        "over black: it is cut off there, before the converter's end; look at its supply and what writes it"
    )


def _medians_and_clipping(counts: Array, black: Flags) -> tuple[tuple[float, float], tuple[int, int]]:
    """Usual reading over white and over black, and whether it is cut off."""
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
