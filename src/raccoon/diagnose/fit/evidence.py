"""Log evidence of sets of columns in a linear model with unit normal priors, by linear algebra alone.

Around a working point the whitened data are y = X u + w with unit noise w and unit normal priors on u: each
column of X is one direction of the model times the width of its prior. Some columns are always included (base
numbers, slowly varying floor friction); each cause adds one or more. The log evidence of a set I is

    log p(y | I) = 1/2 h' (1 + G)^-1 h - 1/2 log det(1 + G) + const,   G = X_I' X_I,  h = X_I' y

(Bayesian linear regression; Bishop 2006, eq. 3.86). The columns that are always included are eliminated once
(Schur complement), so scoring a set takes a solve for its own few columns.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


MAX_ACTIVE_SET_SWEEPS = 10
"""Maximum number of changes of the active set, the coordinates that are fixed at a bound."""


def minimise_in_bounds(
    matrix: Array, projection: Array, low: Array, high: Array, near: Array | None = None
) -> Array:
    """Minimise u' matrix u - 2 projection' u subject to low <= u <= high, for a positive definite matrix.

    Active-set method: coordinates that would leave their bounds are fixed there, the others are solved for,
    and those whose gradient points inwards are freed again. It usually ends after two or three sweeps; if it
    cycles, bounded least squares is used instead.

    near: a point at the bounds that are likely to be active; it changes the computing time only.
    """
    found = np.zeros(len(projection)) if near is None else np.clip(near, low, high)
    free = np.ones(len(projection), bool) if near is None else (found > low) & (found < high)
    _solve_free(matrix, projection, found, free)
    for _ in range(MAX_ACTIVE_SET_SWEEPS):
        outside = free & ((found < low) | (found > high))
        if outside.any():
            found[outside] = np.clip(found, low, high)[outside]
            free &= ~outside
        else:
            freed = ~free & ((projection - matrix @ found) * np.where(found <= low, 1.0, -1.0) > 0.0)
            if not freed.any():
                return found
            free |= freed
        _solve_free(matrix, projection, found, free)
    return _minimise_by_bvls(matrix, projection, low, high)


def _solve_free(matrix: Array, projection: Array, found: Array, free: NDArray[np.bool_]) -> None:
    """Solve for the free coordinates with the others fixed, in place."""
    if free.all():
        found[:] = np.linalg.solve(matrix, projection)
        return
    inside, held = np.flatnonzero(free), np.flatnonzero(~free)
    rows = inside[:, None]  # as np.ix_ would make them, which takes as long as the solve
    pull = projection[inside] - matrix[rows, held] @ found[held]
    found[inside] = np.linalg.solve(matrix[rows, inside], pull)


def _minimise_by_bvls(matrix: Array, projection: Array, low: Array, high: Array) -> Array:
    """The same by bounded-variable least squares (Stark and Parker 1995)."""
    from scipy.optimize import lsq_linear

    factor = np.linalg.cholesky(matrix)
    wide = np.where(high > low, high, low + 1e-12)
    solved = lsq_linear(factor.T, np.linalg.solve(factor, projection), (low, wide), method="bvls")
    return np.asarray(np.clip(solved.x, low, high), float)


@dataclass(frozen=True, slots=True)
class Gram:
    """Sufficient statistics of a block of data: G = X'X (matrix), h = X'y (projection)."""

    matrix: Array
    projection: Array

    @classmethod
    def of(cls, columns: Array, target: Array) -> Gram:
        """Statistics of columns (n, m) and target (n,)."""
        return cls(columns.T @ columns, columns.T @ target)

    def __sub__(self, other: Gram) -> Gram:
        return Gram(self.matrix - other.matrix, self.projection - other.projection)

    def __add__(self, other: Gram) -> Gram:
        return Gram(self.matrix + other.matrix, self.projection + other.projection)

    def take(self, index: Sequence[int] | Array) -> Gram:
        """The statistics of these columns only."""
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
        """The statistics with each column multiplied by a number, as is the standard deviation of its
        prior."""
        return Gram(self.matrix * np.outer(sizes, sizes), self.projection * sizes)

    def shifted(self, held: Array) -> Gram:
        """The statistics for the target less the columns' contribution at the coordinates `held`."""
        return Gram(self.matrix, self.projection - self.matrix @ held)

    def eliminate_leading(self, count: int) -> Gram:
        """Marginalise the first `count` columns under their unit priors: the rest acts like new data."""
        inner = np.linalg.inv(np.eye(count) + self.matrix[:count, :count])
        cross = self.matrix[count:, :count]
        matrix = self.matrix[count:, count:] - cross @ inner @ cross.T
        projection = self.projection[count:] - cross @ inner @ self.projection[:count]
        return Gram(0.5 * (matrix + matrix.T), projection)

    def solve_beside_bounded(
        self, low: Array, high: Array, spans: Sequence[Sequence[int]]
    ) -> Iterator[tuple[Array, float]]:
        """For each span of further columns, its most likely coordinates and the log evidence that it adds.

        The first columns stay within their bounds; a span's have none. Laplace's method with the curvature of
        all columns, as in `Fit.evidence`: log det of all = log det of the first + log det of the span's Schur
        complement.
        """
        count = len(low)
        leading, inner = list(range(count)), Gram(np.eye(len(self.matrix)) + self.matrix, self.projection)
        first, first_cost = inner.take(leading)._minimise_in_bounds(low, high, None)
        inverse = np.linalg.inv(inner.matrix[:count, :count])
        for span in spans:
            unbounded, zeros = np.full(len(span), np.inf), np.zeros(len(span))
            whole = inner.take([*leading, *span])
            limits = np.concatenate([low, -unbounded]), np.concatenate([high, unbounded])
            mean, cost = whole._minimise_in_bounds(*limits, np.concatenate([first, zeros]))
            cross = whole.matrix[count:, :count]
            schur = whole.matrix[count:, count:] - cross @ inverse @ cross.T
            yield mean[count:], -0.5 * (cost - first_cost + float(np.linalg.slogdet(schur)[1]))

    def _minimise_in_bounds(self, low: Array, high: Array, near: Array | None) -> tuple[Array, float]:
        """Most likely coordinates within bounds, and their cost; the matrix must include the priors."""
        mean = minimise_in_bounds(self.matrix, self.projection, low, high, near)
        return mean, float(mean @ self.matrix @ mean - 2.0 * self.projection @ mean)


def split_rows(rows: int, count: int) -> list[slice]:
    """`count` blocks of consecutive rows."""
    return [slice(start, end) for start, end in pairwise(np.linspace(0, rows, count + 1).astype(int))]


def held_out_residual(columns: Array, target: Array, blocks: int) -> Array:
    """Residual of each block of rows by a fit of all others, (n,). columns (m, n), target (n,)."""
    total, residual = Gram.of(columns.T, target), target.copy()
    for part in split_rows(len(target), blocks):
        inside = columns[:, part]
        mean, _, _ = (total - Gram.of(inside.T, target[part])).solve()
        residual[part] -= mean @ inside
    return residual
