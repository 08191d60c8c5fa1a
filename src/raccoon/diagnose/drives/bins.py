"""Even time bins of samples, runs of true flags, and time spans in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_LISTED = 3
"""Largest number of spans that are listed."""


def bin_means(place: NDArray[np.intp], values: Array, count: int) -> Array:
    """Mean of the samples in each of `count` bins, NaN for empty bins. place (n,): the bin of each sample."""
    seen = np.isfinite(values)
    sizes = np.bincount(place[seen], minlength=count)
    sums = np.bincount(place[seen], weights=values[seen], minlength=count)
    return np.where(sizes > 0, sums / np.maximum(sizes, 1), np.nan)


def low_pass(values: Array, step: float, seconds: float) -> Array:
    """First-order low-pass of samples `step` s apart, with the time constant `seconds`, starting from 0."""
    keep = float(np.exp(-step / seconds))
    return solve_recursion(np.full(len(values), keep), (1.0 - keep) * np.asarray(values, float))


def solve_recursion(decay: Array, inputs: Array) -> Array:
    """y (..., samples) of y[k] = decay[k] y[k - 1] + inputs[k], from 0. decay: (samples,)."""
    # Importing scipy.signal for its lfilter would take longer than all that a diagnosis filters.
    from scipy.linalg.lapack import dtbtrs

    bands = np.ones((2, len(decay)), order="F")
    bands[1, :-1] = -decay[1:]
    solution, _ = dtbtrs(bands, inputs.T, uplo="L", diag="U")
    return np.asarray(solution.T, float)


def bin_indices(at: Array, time: Array) -> NDArray[np.intp]:
    """The index of the bin that each sample falls into. at: the samples' times, s. time: the bins' starts,
    s."""
    return np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)


def values_at_bins(at: Array, values: Array, time: Array, width: float) -> Array:
    """The value in force in the middle of each bin, by zero-order hold. values (samples, ...), valid from
    their times `at` (s) on. time: the bins' starts, s. width: of a bin, s."""
    rows = np.searchsorted(at, time + 0.5 * width, side="right") - 1
    return np.asarray(values[np.clip(rows, 0, len(values) - 1)], float)


def describe_spans(spans: Sequence[tuple[float, float]]) -> str:
    """Time spans (start, end), s, in words: the first MAX_LISTED, and the number of the others."""
    shown = ", ".join(f"from {start:.1f} to {end:.1f} s" for start, end in spans[:MAX_LISTED])
    return shown + (f" and {len(spans) - MAX_LISTED} times more" if len(spans) > MAX_LISTED else "")


def runs_of_true(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and end index (exclusive) of each run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]
