"""Sorts readings of a reflectance sensor into those over black, over white, and on an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.noise import MIN_READINGS, robust_sd

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MIN_CONTRAST = 12.0
"""Least contrast between white and black, counts."""
MAX_LABEL_GAP_RATIO = 3.0
"""Factor on the usual distance of two labels beyond which the surface between them is unknown."""
MIN_CONTRAST_SIGMAS = 5.0
"""Least difference of two levels, in standard deviations of the noise."""
EDGE_SHARE = 0.2
"""Distance from a level, as a share of the contrast, beyond which readings are on an edge."""
EDGE_S = 0.03
"""Time, s, for which a spot of 5 mm is over an edge before its middle and after, at 0.08 m/s."""


def labelled_readings(time: Array, counts: Array, surface: Array | None) -> tuple[Array, Array, Array | None]:
    """Time, counts and surface of the labelled readings; all readings and None without labels.

    Alternating labels are written when they change, and hold until the next one. If a reference is slower
    than the readings, blanks between two equal labels have the same label.
    """
    known = np.flatnonzero([] if surface is None else np.isfinite(surface))
    if surface is None or not len(known):
        return time, counts, None
    labels, held = surface[known] > 0.5, np.searchsorted(known, np.arange(len(surface)), side="right") - 1
    label = labels[np.maximum(held, 0)]
    is_labelled = held >= 0
    if not (labels[1:] != labels[:-1]).all():
        after = np.minimum(held + 1, len(known) - 1)
        gap = np.append(np.diff(known), 1)
        between = (labels[after] == label) & (
            gap[np.maximum(held, 0)] <= MAX_LABEL_GAP_RATIO * np.median(gap)
        )
        is_labelled &= between & (np.arange(len(surface)) <= known[-1])
        is_labelled[known] = True
    return time[is_labelled], counts[is_labelled], label[is_labelled].astype(float)


def count_visits(black: Flags) -> int:
    """Number of times that black was entered."""
    return int((np.diff(black.astype(int), prepend=0) == 1).sum())


def is_off_edges(time: Array, black: Flags) -> Flags:
    """Flags of readings off the edges: not beside a change of surface, nor within the time of the spot over
    an edge."""
    changed = np.flatnonzero(np.diff(black.astype(int)) != 0)
    is_off_edge = np.ones(len(black), np.bool_)
    for row in changed:
        start, end = np.searchsorted(time, [time[row] - EDGE_S, time[row + 1] + EDGE_S])
        is_off_edge[min(int(start), row) : max(int(end), row + 2)] = False
    return is_off_edge


def sort_by_threshold(counts: Array, piece: NDArray[np.intp], noise: float) -> tuple[Flags, Flags] | None:
    """Flags of black (high) readings, and of certain ones; None if none is certain. Each piece of time has
    its own threshold, since light may change."""
    smoothed = _median_of_three(counts)
    overall = two_means_threshold(smoothed, noise)
    thresholds = {
        int(index): two_means_threshold(smoothed[piece == index], noise) for index in np.unique(piece)
    }
    black, is_sure = np.zeros(len(counts), np.bool_), np.zeros(len(counts), np.bool_)
    for index, piece_threshold in thresholds.items():
        mine = piece == index
        if piece_threshold is None or (
            overall is not None and piece_threshold[2] - piece_threshold[0] < 0.5 * (overall[2] - overall[0])
        ):
            piece_threshold = overall
        if piece_threshold is None:
            continue
        low, middle, high = piece_threshold
        margin = max(EDGE_SHARE * (high - low), 4.0 * noise)
        black[mine] = counts[mine] > middle
        is_sure[mine] = np.minimum(np.abs(counts[mine] - low), np.abs(counts[mine] - high)) < margin
    if not is_sure.any():
        return None
    return black, is_sure & _has_equal_neighbour(black)


def _has_equal_neighbour(black: Flags) -> Flags:
    """Flags of readings with a neighbour on the same surface: a single one is a spike."""
    is_equal = black[1:] == black[:-1]
    return np.asarray(np.append(False, is_equal) | np.append(is_equal, False), np.bool_)


def _median_of_three(counts: Array) -> Array:
    """The median of each reading and its neighbours."""
    around = np.pad(counts, 1, mode="edge")
    return np.asarray(np.median([around[:-2], around[1:-1], around[2:]], axis=0), float)


def two_means_threshold(counts: Array, noise: float) -> tuple[float, float, float] | None:
    """(white, threshold, black) by two-means clustering with medians; None for readings of a single surface
    that drifts or is uneven, whose two levels are no farther apart than each scatters."""
    if len(counts) < 2 * MIN_READINGS:
        return None
    ordered = np.sort(counts)
    low, high = float(ordered[MIN_READINGS // 2]), float(ordered[-1 - MIN_READINGS // 2])
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
    spread = max(robust_sd(counts[counts <= middle]), robust_sd(counts[counts > middle]), noise)
    if high - low < max(MIN_CONTRAST, MIN_CONTRAST_SIGMAS * spread):
        return None
    return low, middle, high
