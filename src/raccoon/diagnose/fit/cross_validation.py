"""Held-out errors: each half second is predicted by a fit of all others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import Gram

Array = NDArray[np.float64]

MIN_DIRECTION_VARIANCE = 0.02
"""Variance, in units of the noise, below which a direction is left out, since it has no effect."""
MIN_HELD_OUT_SHARE = 0.003
"""Lower bound on the eigenvalues of 1 - X_b C X_b', the share of a direction that the other half seconds
determine: below it they cannot predict the direction."""


@dataclass(frozen=True, slots=True)
class RecordingPart:
    """A part of a recording, with directions that the whole recording shares and slowly varying directions of
    this part alone.

    columns (columns, bins, channels), target (bins, channels): before whitening; the first `slow` columns are
    the slowly varying directions. white (columns, rows), goal (rows,): the same, whitened. gram: Gram matrix
    of the whitened columns and target.
    """

    columns: Array
    white: Array
    target: Array
    goal: Array
    gram: Gram
    slow: int

    @classmethod
    def of(cls, columns: Array, white: Array, target: Array, goal: Array, slow: int) -> RecordingPart:
        """white, goal: columns and target, whitened. The first `slow` columns are the slowly varying
        directions."""
        rows, flat = white.reshape(len(white), -1), goal.reshape(-1)
        return cls(columns, rows, target, flat, Gram.of(rows.T, flat), slow)

    def scaled(self, wander: float) -> Gram:
        """The Gram matrix if the slowly varying directions have the standard deviation `wander`."""
        return self.gram.scaled(np.repeat([wander, 1.0], [self.slow, len(self.columns) - self.slow]))


def log_evidence_of_wander(parts: Sequence[RecordingPart], wander: float) -> float:
    """Log evidence of all columns, for a standard deviation `wander` of the slowly varying ones and 1 of the
    others."""
    grams = [each.scaled(wander) for each in parts]
    alone = sum(gram.take(range(each.slow)).evidence() for gram, each in zip(grams, parts, strict=True))
    return alone + reduce(add, map(Gram.eliminate_leading, grams, (each.slow for each in parts))).evidence()


def held_out_error(parts: Sequence[RecordingPart], sizes: Array, wander: float, event: int) -> Array:
    """Error of the prediction of each half second by columns fitted to all others, (bins, channels).

    sizes (known,), wander: standard deviations of the priors of the shared and of the slowly varying
    directions. For a part, all other parts reduce to a mean and a covariance of the shared directions (with
    their slowly varying ones eliminated), which are its prior. event: bins in half a second; parts consist of
    whole ones.
    """
    shared = [each.scaled(wander).eliminate_leading(each.slow) for each in parts]
    errors = []
    for number, part in enumerate(parts):
        others = [*shared[:number], *shared[number + 1 :]]  # subtracting from a total would lose digits
        covariance = np.linalg.inv(sum((each.matrix for each in others), np.diag(1.0 / sizes**2)))
        projection = sum((each.projection for each in others), np.zeros(len(sizes)))
        prior = np.zeros((len(part.columns),) * 2)
        prior[: part.slow, : part.slow] = wander * np.eye(part.slow)
        prior[part.slow :, part.slow :] = np.linalg.cholesky(0.5 * (covariance + covariance.T))
        mean = np.zeros(len(prior))
        mean[part.slow :] = covariance @ projection
        errors.append(_held_out_error_of_part(part, prior, mean, event))
    return np.concatenate(errors)


def _held_out_error_of_part(part: RecordingPart, prior: Array, expected: Array, event: int) -> Array:
    """`held_out_error` of one part, for a prior with mean `expected` and covariance S = prior prior'.

    The fit's mean is m = C X' y with C = (S^-1 + X' X)^-1 and y the target less the prediction of the prior
    mean. Leaving out rows b changes it to m - C X_b' (1 - X_b C X_b')^-1 (y_b - X_b m) (Woodbury).
    """
    powers, vectors = np.linalg.eigh(prior.T @ part.gram.matrix @ prior)
    strong = powers > MIN_DIRECTION_VARIANCE
    vectors = prior @ (vectors[:, strong] / np.sqrt(1.0 + powers[strong]))  # C = vectors vectors'
    turned = vectors.T @ part.white
    goal = part.goal - expected @ part.white
    mean = turned @ goal
    rest = goal - mean @ turned
    event *= part.target.shape[1]
    flat = part.columns.reshape(len(part.columns), -1)
    error = part.target.reshape(-1) - expected @ flat
    for start in range(0, len(error), event):
        rows = slice(start, start + event)
        share = turned[:, rows]
        others = vectors @ (mean - _influence(share, rest[rows]))
        error[rows] -= others @ flat[:, rows]
    return np.asarray(error.reshape(part.target.shape), float)


def _influence(part: Array, rest: Array) -> Array:
    """P (1 - P' P)^-1 times the residual of a half second, with P (directions, rows) and P' P = X_b C X_b'.
    Solved in rows or in directions, whichever are fewer, since it is (1 - P P')^-1 P as well.

    A direction that shows in this half second only is not predicted by the others at all. A wheel that slips
    and stops gives one: a reading jumps there if a number changes slightly. Its residual is no measure of
    noise, so `MIN_HELD_OUT_SHARE` limits its influence.
    """
    few = len(part) < len(rest)
    inner, goal = (part @ part.T, part @ rest) if few else (part.T @ part, rest)
    left_out = np.eye(len(inner)) - inner
    try:
        np.linalg.cholesky(left_out - MIN_HELD_OUT_SHARE * np.eye(len(inner)))
        pull = np.linalg.solve(left_out, goal)
    except np.linalg.LinAlgError:
        shares, vectors = np.linalg.eigh(left_out)
        pull = vectors @ ((vectors.T @ goal) / np.maximum(shares, MIN_HELD_OUT_SHARE))
    return np.asarray(pull if few else part @ pull, float)
