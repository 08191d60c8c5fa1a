"""Which readings of a reflectance sensor lie over black, which over white, and which on an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.noise import FEWEST, spread_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LEAST_CONTRAST = 12.0
"""Counts between white and black at least."""
MOST_BLANKS = 3.0
"""Times the usual distance of two labels beyond which the surface between them may have been another."""
CLEAR = 5.0
"""Noise deviations that the two levels must lie apart to be two."""
EDGE = 0.2
"""Share of the contrast around a level; readings outside lie on an edge."""
EDGE_SECONDS = 0.03
"""s: a spot of 5 mm is over an edge for so long, before its middle and after, at 0.08 m/s."""


def labelled(time: Array, counts: Array, surface: Array | None) -> tuple[Array, Array, Array | None]:
    """The readings of which a reference says the surface; all, and None, where none says it.

    Labels that are each another one than the last are written when they change, and hold till the next. Of a
    reference that is slower than the readings the blanks between two alike labels are as these.
    """
    known = np.flatnonzero([] if surface is None else np.isfinite(surface))
    if surface is None or not len(known):
        return time, counts, None
    labels, held = surface[known] > 0.5, np.searchsorted(known, np.arange(len(surface)), side="right") - 1
    label = labels[np.maximum(held, 0)]
    told = held >= 0
    if not (labels[1:] != labels[:-1]).all():
        after = np.minimum(held + 1, len(known) - 1)
        gap = np.append(np.diff(known), 1)
        between = (labels[after] == label) & (gap[np.maximum(held, 0)] <= MOST_BLANKS * np.median(gap))
        told &= between & (np.arange(len(surface)) <= known[-1])
        told[known] = True
    return time[told], counts[told], label[told].astype(float)


def visits(black: Flags) -> int:
    """How often black was come to."""
    return int((np.diff(black.astype(int), prepend=0) == 1).sum())


def far_from_change(time: Array, black: Flags) -> Flags:
    """Not on an edge: not beside a change of surface, nor within the time that the spot takes over one."""
    changed = np.flatnonzero(np.diff(black.astype(int)) != 0)
    sure = np.ones(len(black), np.bool_)
    for row in changed:
        start, end = np.searchsorted(time, [time[row] - EDGE_SECONDS, time[row + 1] + EDGE_SECONDS])
        sure[min(int(start), row) : max(int(end), row + 2)] = False
    return sure


def by_reading(counts: Array, piece: NDArray[np.intp], noise: float) -> tuple[Flags, Flags] | None:
    """Black reads high. The threshold is found anew in each piece, for light that changes."""
    plain = _without_spikes(counts)
    overall = threshold(plain, noise)
    each_own = {int(index): threshold(plain[piece == index], noise) for index in np.unique(piece)}
    black, sure = np.zeros(len(counts), np.bool_), np.zeros(len(counts), np.bool_)
    for index, own in each_own.items():
        mine = piece == index
        if own is None or (overall is not None and own[2] - own[0] < 0.5 * (overall[2] - overall[0])):
            own = overall
        if own is None:
            continue
        low, middle, high = own
        margin = max(EDGE * (high - low), 4.0 * noise)
        black[mine] = counts[mine] > middle
        sure[mine] = np.minimum(np.abs(counts[mine] - low), np.abs(counts[mine] - high)) < margin
    if not sure.any():
        return None
    return black, sure & _beside_alike(black)


def _beside_alike(black: Flags) -> Flags:
    """Readings with a neighbour on the same surface: a lone one is a spike."""
    alike = black[1:] == black[:-1]
    return np.asarray(np.append(False, alike) | np.append(alike, False), np.bool_)


def _without_spikes(counts: Array) -> Array:
    """The median of each reading and its neighbours."""
    around = np.pad(counts, 1, mode="edge")
    return np.asarray(np.median([around[:-2], around[1:-1], around[2:]], axis=0), float)


def threshold(counts: Array, noise: float) -> tuple[float, float, float] | None:
    """(white, threshold, black) by two means; None where the readings are of one surface, which drifts or is
    uneven: then the two lie no farther apart than each of them spreads."""
    if len(counts) < 2 * FEWEST:
        return None
    ordered = np.sort(counts)
    low, high = float(ordered[FEWEST // 2]), float(ordered[-1 - FEWEST // 2])
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = counts > middle
        if not above.any() or above.all():
            return None
        moved = float(np.median(counts[~above])), float(np.median(counts[above]))
        if moved == (low, high):
            break
        low, high = moved
    middle = 0.5 * (low + high)
    spread = max(spread_of(counts[counts <= middle]), spread_of(counts[counts > middle]), noise)
    if high - low < max(LEAST_CONTRAST, CLEAR * spread):
        return None
    return low, middle, high
