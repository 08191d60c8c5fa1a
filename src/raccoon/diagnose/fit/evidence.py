"""Evidence of sets of causes in a linearised model, by algebra alone.

Around a working point the whitened data are y = X u + w with unit noise w and unit normal priors on u: every
column of X is one direction of the model times the width of its prior. Some columns are always in (what
robot.toml leaves open, slow floor friction); each cause adds one or more. The log evidence of a set I is

    log p(y | I) = 1/2 h' (1 + G)^-1 h - 1/2 log det(1 + G) + const,   G = X_I' X_I,  h = X_I' y

(Bayesian linear regression; Bishop 2006, eq. 3.86). The always-in columns are eliminated once (Schur
complement), so scoring a set costs a solve of its own few columns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


MAX_ACTIVE_SET_SWEEPS = 10
"""Most times that it is asked anew which coordinates a bound holds."""


def minimise_in_bounds(
    matrix: Array, projection: Array, low: Array, high: Array, near: Array | None = None
) -> Array:
    """Where u' matrix u - 2 projection' u is least inside bounds around 0; matrix: positive definite.

    By active sets: what would leave is held at its bound, the others go to where they are best beside it, and
    what is pushed inwards there is let go again. That is quick where it ends, which it mostly does after two
    or three times; where it goes round in circles the slow way is taken.

    near: a point at the bounds that are likely to hold; it changes how long that takes, and nothing else.
    """
    found = np.zeros(len(projection)) if near is None else np.clip(near, low, high)
    free = np.ones(len(projection), bool) if near is None else (found > low) & (found < high)
    _solve_free(matrix, projection, found, free)
    for _ in range(MAX_ACTIVE_SET_SWEEPS):
        out = free & ((found < low) | (found > high))
        if out.any():
            found[out] = np.clip(found, low, high)[out]
            free &= ~out
        else:
            back = ~free & ((projection - matrix @ found) * np.where(found <= low, 1.0, -1.0) > 0.0)
            if not back.any():
                return found
            free |= back
        _solve_free(matrix, projection, found, free)
    return _minimise_by_bvls(matrix, projection, low, high)


def _solve_free(matrix: Array, projection: Array, found: Array, free: NDArray[np.bool_]) -> None:
    """Move what is free to where it is best beside the rest."""
    if free.all():
        found[:] = np.linalg.solve(matrix, projection)
        return
    inside, held = np.flatnonzero(free), np.flatnonzero(~free)
    rows = inside[:, None]  # as np.ix_ has them, which takes as long as to solve
    pull = projection[inside] - matrix[rows, held] @ found[held]
    found[inside] = np.linalg.solve(matrix[rows, inside], pull)


def _minimise_by_bvls(matrix: Array, projection: Array, low: Array, high: Array) -> Array:
    """The same by bounded least squares, one coordinate after the other (Stark and Parker 1995)."""
    from scipy.optimize import lsq_linear

    factor = np.linalg.cholesky(matrix)
    wide = np.where(high > low, high, low + 1e-12)
    solved = lsq_linear(factor.T, np.linalg.solve(factor, projection), (low, wide), method="bvls")
    return np.asarray(np.clip(solved.x, low, high), float)


@dataclass(frozen=True, slots=True)
class Gram:
    """What a block of data says of its columns: G = X'X, h = X'y."""

    matrix: Array
    projection: Array

    @classmethod
    def of(cls, columns: Array, target: Array) -> Gram:
        """columns (n, m), target (n,)."""
        return cls(columns.T @ columns, columns.T @ target)

    def __sub__(self, other: Gram) -> Gram:
        return Gram(self.matrix - other.matrix, self.projection - other.projection)

    def __add__(self, other: Gram) -> Gram:
        return Gram(self.matrix + other.matrix, self.projection + other.projection)

    def take(self, index: Sequence[int] | Array) -> Gram:
        """Only these columns."""
        chosen = np.asarray(index, int)
        return Gram(self.matrix[chosen[:, None], chosen], self.projection[chosen])

    def solve(self) -> tuple[Array, float, Array]:
        """Posterior mean, log evidence relative to no columns, posterior covariance."""
        inner = np.eye(len(self.projection)) + self.matrix
        covariance: Array = np.asarray(np.linalg.inv(inner), float)
        mean = covariance @ self.projection
        sign, logdet = np.linalg.slogdet(inner)
        if sign <= 0:
            return mean, -np.inf, covariance
        return mean, float(0.5 * self.projection @ mean - 0.5 * logdet), covariance

    def evidence(self) -> float:
        """Log evidence relative to no columns."""
        factor = np.linalg.cholesky(np.eye(len(self.projection)) + self.matrix)
        half = np.linalg.solve(factor, self.projection)
        return float(0.5 * half @ half - np.log(np.diag(factor)).sum())

    def scaled(self, sizes: Array) -> Gram:
        """Each column times a number: what its prior's standard deviation is then."""
        return Gram(self.matrix * np.outer(sizes, sizes), self.projection * sizes)

    def shifted(self, held: Array) -> Gram:
        """The target less what the columns at `held` make of it."""
        return Gram(self.matrix, self.projection - self.matrix @ held)

    def eliminate_leading(self, always: int) -> Gram:
        """Eliminate the first `always` columns, which keep their unit prior: what is left behaves as new
        data."""
        inner = np.linalg.inv(np.eye(always) + self.matrix[:always, :always])
        cross = self.matrix[always:, :always]
        matrix = self.matrix[always:, always:] - cross @ inner @ cross.T
        projection = self.projection[always:] - cross @ inner @ self.projection[:always]
        return Gram(0.5 * (matrix + matrix.T), projection)

    def solve_beside_bounded(
        self, low: Array, high: Array, spans: Sequence[Sequence[int]]
    ) -> Iterator[tuple[Array, float]]:
        """Of each span of further columns, without bounds, the most likely coordinates beside the first ones,
        which stay inside theirs, and the log evidence that it adds: by Laplace's method with the curvature of
        all columns, as `Fit.evidence` has it.

        log det of all = log det of the first + log det of what the span has beside them (Schur).
        """
        count = len(low)
        own, inner = list(range(count)), Gram(np.eye(len(self.matrix)) + self.matrix, self.projection)
        first, before = inner.take(own)._minimise_in_bounds(low, high, None)
        inverse = np.linalg.inv(inner.matrix[:count, :count])
        for span in spans:
            far, none = np.full(len(span), np.inf), np.zeros(len(span))
            whole = inner.take([*own, *span])
            limits = np.concatenate([low, -far]), np.concatenate([high, far])
            mean, cost = whole._minimise_in_bounds(*limits, np.concatenate([first, none]))
            cross = whole.matrix[count:, :count]
            left = whole.matrix[count:, count:] - cross @ inverse @ cross.T
            yield mean[count:], -0.5 * (cost - before + float(np.linalg.slogdet(left)[1]))

    def _minimise_in_bounds(self, low: Array, high: Array, near: Array | None) -> tuple[Array, float]:
        """Most likely coordinates inside bounds, and what they cost, where the priors are in the matrix."""
        mean = minimise_in_bounds(self.matrix, self.projection, low, high, near)
        return mean, float(mean @ self.matrix @ mean - 2.0 * self.projection @ mean)


def split_rows(rows: int, count: int) -> list[slice]:
    """So many blocks of neighbouring rows."""
    return [slice(start, end) for start, end in pairwise(np.linspace(0, rows, count + 1).astype(int))]


def held_out_residual(columns: Array, target: Array, blocks: int) -> Array:
    """What is left of each block of rows by a fit of all others, (n,). columns (m, n), target (n,)."""
    total, left = Gram.of(columns.T, target), target.copy()
    for part in split_rows(len(target), blocks):
        inside = columns[:, part]
        mean, _, _ = (total - Gram.of(inside.T, target[part])).solve()
        left[part] -= mean @ inside
    return left
