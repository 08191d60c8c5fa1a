"""Samples in even bins, and runs of flags: what is seen of a drive before anything is simulated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bin_means(place: NDArray[np.intp], values: Array, count: int) -> Array:
    """The mean of the samples of each of so many bins, NaN where it has none. place: (n,), each one's bin."""
    seen = np.isfinite(values)
    sizes = np.bincount(place[seen], minlength=count)
    sums = np.bincount(place[seen], weights=values[seen], minlength=count)
    return np.where(sizes > 0, sums / np.maximum(sizes, 1), np.nan)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one after the last of each run of flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]
