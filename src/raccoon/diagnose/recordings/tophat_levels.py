"""What a reflectance sensor read over white and over black, piece of time by piece of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

PIECES = 10
FEWEST = 8
LEAST_CONTRAST = 12.0
CLEAR = 5.0
"""Noise deviations that the two levels must lie apart to be two."""
EDGE = 0.2
"""Share of the contrast around a level; readings outside lie on an edge."""
SMALLEST_SD = 1.0
CUT = 0.1
"""Share of a surface's readings at the end of the converter from which its level is cut off."""
OUTLIER = 5.0
"""Noise deviations from which a step between neighbours is no noise."""


@dataclass(frozen=True, slots=True)
class Levels:
    """Readings of one sensor sorted by surface.

    time, counts, black (n,): the readings that lie clearly on a surface. noise: counts, sd of a reading.
    piece (n,): piece of time of each. usual: counts, white and black over all. cut: for white and black, 1
    where the level is cut off at the converter's largest value, -1 at 0, else 0.
    """

    time: Array
    counts: Array
    black: Flags
    noise: float
    piece: NDArray[np.intp]
    usual: tuple[float, float]
    cut: tuple[int, int]

    @property
    def whole(self) -> int:
        """How many of the two levels were read as they are."""
        return self.cut.count(0)

    def part(self, keep: Flags) -> Levels | None:
        """The levels of a part of the time; None where it did not see enough of both."""
        if min((keep & self.black).sum(), (keep & ~self.black).sum()) < FEWEST:
            return None
        time, counts, black = self.time[keep], self.counts[keep], self.black[keep]
        return Levels(time, counts, black, self.noise, pieces(time), *_usual(counts, black))

    def means(self, keep: Flags) -> Array:
        """Rows of piece, black 0/1, mean, deviation of the mean, for pieces with enough readings."""
        rows = []
        for piece in range(PIECES):
            for black in (False, True):
                mine = keep & (self.piece == piece) & (self.black == black)
                if mine.sum() >= FEWEST:
                    values = self.counts[mine]
                    rows.append((piece, float(black), float(values.mean()), self._deviation(values)))
        return np.array(rows).reshape(-1, 4)

    def _deviation(self, values: Array) -> float:
        # The floor's own brightness is alike for neighbouring readings: a tenth of them counts.
        return float(max(float(values.std()), self.noise) / np.sqrt(max(len(values) / 10.0, 1.0)))


def levels_of(time: Array, counts: Array, surface: Array | None) -> Levels | str:
    """Sort the readings. surface: 1 black, 0 white where a reference says so, else the readings decide.

    Gives the reason as text where it cannot be done.
    """
    known = np.isfinite(counts)
    time, counts = time[known], counts[known]
    if len(counts) < 4 * FEWEST:
        return f"it has {len(counts)} readings: at least {4 * FEWEST} are needed"
    noise = _noise(np.diff(counts))
    piece = pieces(time)
    if surface is not None:
        black = surface[known] > 0.5
        sure = _far_from_change(black)
    else:
        sorted_ = _by_reading(counts, piece, noise)
        if sorted_ is None:
            return _one_surface(counts)
        black, sure = sorted_
    if min((sure & black).sum(), (sure & ~black).sum()) < FEWEST:
        return _one_surface(counts)
    usual, cut = _usual(counts[sure], black[sure])
    # Edges are steps, not noise; and what is cut off has none.
    steady = sure & _far_from_change(black) & np.where(black, cut[1] == 0, cut[0] == 0)
    pairs = steady[1:] & steady[:-1] & (black[1:] == black[:-1])
    if pairs.sum() >= FEWEST:
        noise = _noise(np.diff(counts)[pairs])
    if abs(usual[1] - usual[0]) < max(LEAST_CONTRAST, CLEAR * noise):
        end = "; both are cut off: it is saturated" if 0 not in cut else ""
        return f"white ({usual[0]:.0f}) and black ({usual[1]:.0f} counts) cannot be told apart{end}"
    if usual[1] < usual[0]:
        return (
            f"black ({usual[1]:.0f}) reads lower than white ({usual[0]:.0f} counts), which no light, gain or "
            "height does: the labels of black and white look swapped"
        )
    if 0 not in cut:
        return f"white ({usual[0]:.0f}) and black ({usual[1]:.0f} counts) are both cut off"
    return Levels(time[sure], counts[sure], black[sure], noise, piece[sure], usual, cut)


def pieces(time: Array) -> NDArray[np.intp]:
    """Piece of time of each reading."""
    share = (time - time[0]) / max(float(np.ptp(time)), 1e-9)
    return np.asarray(np.minimum(share * PIECES, PIECES - 1), np.intp)


def _one_surface(counts: Array) -> str:
    ends = float(((counts >= FULL_SCALE) | (counts <= 0.0)).mean())
    cut = f" ({100 * ends:.0f} % of the readings are cut off: it may be saturated)" if ends >= CUT else ""
    return f"only one surface was seen{cut}: drive over black and white"


def _noise(steps: Array) -> float:
    """Deviation of a reading from the steps between neighbours, those at edges and spikes left out."""
    rough = max(1.4826 * float(np.median(np.abs(steps))), np.sqrt(2.0) * SMALLEST_SD)
    usual = steps[np.abs(steps) < OUTLIER * rough]
    return max(float(np.sqrt(np.mean(usual**2) / 2.0)), SMALLEST_SD)


def _usual(counts: Array, black: Flags) -> tuple[tuple[float, float], tuple[int, int]]:
    """Usual reading over white and over black, and whether it is cut off."""
    sides = counts[~black], counts[black]
    white, dark = (float(np.median(each)) for each in sides)
    cut = [
        1 if (each >= FULL_SCALE).mean() >= CUT else -1 if (each <= 0.0).mean() >= CUT else 0
        for each in sides
    ]
    return (white, dark), (cut[0], cut[1])


def _far_from_change(black: Flags) -> Flags:
    """Not within two readings of an edge."""
    changed = np.flatnonzero(np.diff(black.astype(int)) != 0)
    sure = np.ones(len(black), np.bool_)
    for row in changed:
        sure[max(row - 1, 0) : row + 3] = False
    return sure


def _by_reading(counts: Array, piece: NDArray[np.intp], noise: float) -> tuple[Flags, Flags] | None:
    """Black reads high. The threshold is found anew in each piece, for light that changes."""
    overall = _threshold(counts)
    if overall is None or overall[2] - overall[0] < max(LEAST_CONTRAST, CLEAR * noise):
        return None
    black, sure = np.zeros(len(counts), np.bool_), np.zeros(len(counts), np.bool_)
    for index in np.unique(piece):
        mine = piece == index
        found = _threshold(counts[mine])
        if found is None or found[2] - found[0] < 0.5 * (overall[2] - overall[0]):
            found = overall
        low, middle, high = found
        margin = max(EDGE * (high - low), 4.0 * noise)
        black[mine] = counts[mine] > middle
        sure[mine] = np.minimum(np.abs(counts[mine] - low), np.abs(counts[mine] - high)) < margin
    return black, sure


def _threshold(counts: Array) -> tuple[float, float, float] | None:
    """(white, threshold, black) by two means."""
    low, high = (float(each) for each in np.percentile(counts, [2.0, 98.0]))
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = counts > middle
        if not above.any() or above.all():
            return None
        moved = float(np.median(counts[~above])), float(np.median(counts[above]))
        if moved == (low, high):
            break
        low, high = moved
    return low, 0.5 * (low + high), high
