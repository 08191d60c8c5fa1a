"""The error with which each half second is foreseen by a fit of all the others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEEBLE = 0.02
"""Variance, in units of the noise, below which a direction is left out: it would change nothing."""
SHOWN = 0.003
"""Part of a direction's variance that noise must make for other half seconds to foresee it."""


def foreseen_error(
    gram: Array,
    white: Array,
    columns: Array,
    goal: Array,
    target: Array,
    sizes: Array,
    event: int,
) -> Array:
    """target less what columns fitted to all other half seconds make of each half second, (bins, channels).

    With priors of variance S the fit's mean is m = C X' y, C = (S^-1 + X' X)^-1. Leaving rows b out moves it
    to m - C X_b' (1 - X_b C X_b')^-1 (y_b - X_b m) (Woodbury). white, goal: X' and y; gram: X' X; sizes: the
    root of S, (columns,); columns and target: the same as white and goal before whitening.
    event: bins in half a second.
    """
    powers, vectors = np.linalg.eigh(gram * np.outer(sizes, sizes))
    strong = powers > FEEBLE
    vectors = sizes[:, None] * (vectors[:, strong] / np.sqrt(1.0 + powers[strong]))  # C = vectors vectors'
    turned = vectors.T @ white
    mean = turned @ goal
    rest = goal - mean @ turned
    event *= target.shape[1]
    flat = columns.reshape(len(columns), -1)
    error = target.reshape(-1).copy()
    for start in range(0, len(error), event):
        rows = slice(start, start + event)
        part = turned[:, rows]
        others = vectors @ (mean - _pulled(part, rest[rows]))
        error[rows] -= others @ flat[:, rows]
    return error.reshape(target.shape)


def _pulled(part: Array, rest: Array) -> Array:
    """P (1 - P' P)^-1 times the rest of a half second, P (directions, rows) with P' P = X_b C X_b', where the
    other half seconds say anything: by as many equations as there are rows, or directions if these are fewer,
    since it is (1 - P P')^-1 P as well.

    A direction that only this half second shows is not foreseen by the others at all. A wheel that slips and
    stops gives one: a reading jumps there if a number moves by next to nothing. Its rest tells no noise.
    """
    few = len(part) < len(rest)
    inner, goal = (part @ part.T, part @ rest) if few else (part.T @ part, rest)
    unforeseen = np.eye(len(inner)) - inner
    try:
        np.linalg.cholesky(unforeseen - SHOWN * np.eye(len(inner)))
        pull = np.linalg.solve(unforeseen, goal)
    except np.linalg.LinAlgError:
        shares, vectors = np.linalg.eigh(unforeseen)
        pull = vectors @ ((vectors.T @ goal) / np.maximum(shares, SHOWN))
    return np.asarray(pull if few else part @ pull, float)
