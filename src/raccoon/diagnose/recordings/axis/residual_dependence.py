"""Covariates on which the unexplained residual of an axis depends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.axis.fit import AxisData, AxisFit
from raccoon.diagnose.recordings.axis.judge import model_errors

Array = NDArray[np.float64]

BINS = 12
FOLDS = 5
MIN_EXPLAINED_SHARE = 0.15
"""Least share of the residual's variance that a covariate must predict in held-out samples
(cross-validation)."""
MIN_RELATIVE_SHARE = 0.7
"""Least share of a further covariate, relative to the best one's, to be listed with it."""


def residual_dependence(data: AxisData, fit: AxisFit) -> tuple[str, ...]:
    """Names of covariates that predict the growth of the simulation error, best first.

    The growth of the error over pieces of a stretch is used, since a missing force shows in it.
    """
    error, _ = model_errors(data, fit)
    log = data.log
    piece_rows = max(2, data.stretches.count // 10)
    rows = data.stretches.rows()[::piece_rows][:-1]
    sampled = np.nan_to_num(error[::piece_rows])
    growth = np.diff(sampled, axis=0).ravel()
    at = rows[: len(sampled) - 1].ravel()
    if len(growth) < 4 * BINS or not np.ptp(growth) > 0.0:
        return ()
    motion = np.nan_to_num(log.motion)
    effort = log.effort
    covariates = {
        "time": log.time[at],
        log.names[1].rpartition(".")[2]: motion[at],
        log.names[0].rpartition(".")[2]: effort[at],
        f"change of {log.names[0].rpartition('.')[2]}": _largest_change(
            effort, at, piece_rows * data.stretches.every
        ),
    }
    shares = {name: _predicted_share(values, growth) for name, values in covariates.items()}
    limit = max(MIN_EXPLAINED_SHARE, MIN_RELATIVE_SHARE * max(shares.values()))
    return tuple(name for name in sorted(shares, key=lambda each: -shares[each]) if shares[name] >= limit)


def _largest_change(effort: Array, at: NDArray[np.intp], piece: int) -> Array:
    """Largest change of the effort from one sample to the next within each piece."""
    jumps = np.abs(np.diff(effort, append=effort[-1]))
    return np.array([jumps[index : index + piece].max(initial=0.0) for index in at])


def _predicted_share(values: Array, growth: Array) -> float:
    """Share of the variance that means over bins of `values` predict in held-out samples."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)[1:-1]))
    bins = np.searchsorted(edges, values, side="right")
    fold = np.arange(len(values)) * FOLDS // len(values) if len(edges) < 2 else np.arange(len(values)) % FOLDS
    residual = 0.0
    for index in range(FOLDS):
        mine = fold == index
        total = np.bincount(bins[~mine], growth[~mine], len(edges) + 1)
        count = np.bincount(bins[~mine], minlength=len(edges) + 1)
        mean = total / np.maximum(count + 1.0, 1.0)
        residual += float(((growth[mine] - mean[bins[mine]]) ** 2).sum())
    return 1.0 - residual / float((growth**2).sum())
