"""The error with which each half second is foreseen by a fit of all the others."""

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
"""Variance, in units of the noise, below which a direction is left out: it would change nothing."""
MIN_HELD_OUT_SHARE = 0.003
"""Part of a direction's variance that noise must make for other half seconds to foresee it."""


@dataclass(frozen=True, slots=True)
class RecordingPart:
    """A part of a recording: what may differ in all of it, and what wanders in this part alone.

    white (columns, rows), goal (rows,): whitened columns of what wanders, which are so many, then of what may
    differ, and the target. columns (columns, bins, channels), target (bins, channels): before whitening.
    """

    columns: Array
    white: Array
    target: Array
    goal: Array
    gram: Gram
    slow: int

    @classmethod
    def of(cls, columns: Array, white: Array, target: Array, goal: Array, slow: int) -> RecordingPart:
        """white, goal: columns and target whitened. The first `slow` columns are of what wanders."""
        rows, flat = white.reshape(len(white), -1), goal.reshape(-1)
        return cls(columns, rows, target, flat, Gram.of(rows.T, flat), slow)

    def scaled(self, wander: float) -> Gram:
        """Its products, for what wanders with that standard deviation."""
        return self.gram.scaled(np.repeat([wander, 1.0], [self.slow, len(self.columns) - self.slow]))


def log_evidence_of_wander(parts: Sequence[RecordingPart], wander: float) -> float:
    """Log evidence of all columns, of what wanders with that standard deviation and of the others with 1."""
    grams = [each.scaled(wander) for each in parts]
    alone = sum(gram.take(range(each.slow)).evidence() for gram, each in zip(grams, parts, strict=True))
    return alone + reduce(add, map(Gram.eliminate_leading, grams, (each.slow for each in parts))).evidence()


def held_out_error(parts: Sequence[RecordingPart], sizes: Array, wander: float, event: int) -> Array:
    """What was measured less what columns fitted to all other half seconds make of each half second, (bins,
    channels).

    sizes (known,), wander: standard deviations of the priors of what may differ in the whole recording, and
    of what wanders. To a part the others say of the former no more than a mean and a covariance (what wanders
    is eliminated there), which are its prior. event: bins in half a second; parts are of whole ones.
    """
    said = [each.scaled(wander).eliminate_leading(each.slow) for each in parts]
    errors = []
    for number, part in enumerate(parts):
        others = [*said[:number], *said[number + 1 :]]  # less one of the sum of all would lose digits
        covariance = np.linalg.inv(sum((each.matrix for each in others), np.diag(1.0 / sizes**2)))
        pulled = sum((each.projection for each in others), np.zeros(len(sizes)))
        prior = np.zeros((len(part.columns),) * 2)
        prior[: part.slow, : part.slow] = wander * np.eye(part.slow)
        prior[part.slow :, part.slow :] = np.linalg.cholesky(0.5 * (covariance + covariance.T))
        mean = np.zeros(len(prior))
        mean[part.slow :] = covariance @ pulled
        errors.append(_held_out_error_of_part(part, prior, mean, event))
    return np.concatenate(errors)


def _held_out_error_of_part(part: RecordingPart, prior: Array, expected: Array, event: int) -> Array:
    """The same of a part, for a prior of that mean and of the covariance S = prior prior'.

    The fit's mean is m = C X' y, C = (S^-1 + X' X)^-1, y without what the prior's mean makes of it. Leaving
    rows b out moves it to m - C X_b' (1 - X_b C X_b')^-1 (y_b - X_b m) (Woodbury).
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
        np.linalg.cholesky(unforeseen - MIN_HELD_OUT_SHARE * np.eye(len(inner)))
        pull = np.linalg.solve(unforeseen, goal)
    except np.linalg.LinAlgError:
        shares, vectors = np.linalg.eigh(unforeseen)
        pull = vectors @ ((vectors.T @ goal) / np.maximum(shares, MIN_HELD_OUT_SHARE))
    return np.asarray(pull if few else part @ pull, float)
