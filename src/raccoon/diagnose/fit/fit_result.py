"""The result of a fit: a point, its whitened residual, and its columns.

A fit minimises the cost ||w(u)||^2 + ||u||^2 of the whitened residual w and the prior, both in units of one
standard deviation. By Laplace's method the log evidence of the fitted model is then, up to a constant,

    -1/2 (||w||^2 + ||u||^2) - 1/2 log det(1 + J J')
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.problem import Point, Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """A fitted point. whitened_residual (rows,). jacobian (coordinates, rows): whitened columns. free
    (coordinates,): which coordinates are not at a bound."""

    point: Point
    whitened_residual: Array
    jacobian: Array
    cost: float
    free: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem, point: Point, white: Array, jacobian: Array) -> Fit:
        """The fit, with its cost and its free coordinates computed."""
        return cls(point, white, jacobian, cost_of(point, white), inside_bounds(problem, point))

    @cached_property
    def curvature(self) -> Array:
        """1 + J J', the curvature of half the cost."""
        return np.asarray(self.jacobian @ self.jacobian.T + np.eye(len(self.jacobian)), float)

    @property
    def is_finite(self) -> bool:
        """Whether the simulation returned finite numbers at the point and one difference step away from
        it."""
        return bool(np.isfinite(self.cost) and np.isfinite(np.diag(self.curvature)).all())

    @cached_property
    def evidence(self) -> float:
        """Log evidence, comparable between fits under the same whitener."""
        if not self.is_finite:
            return -np.inf
        _, logdet = np.linalg.slogdet(self.curvature)
        return float(-0.5 * self.cost - 0.5 * logdet)

    @property
    def target(self) -> Array:
        """Whitened residual at u = 0 of the free coordinates, according to the linear model."""
        free = self.free
        return np.asarray(self.whitened_residual + self.point.vector()[free] @ self.jacobian[free], float)


def cost_of(point: Point, white: Array) -> float:
    """The cost of a point with this whitened residual; infinite if the simulation returned numbers that are
    not finite."""
    vector = point.vector()
    cost = float(white @ white + vector @ vector)
    return cost if np.isfinite(cost) else np.inf


def inside_bounds(problem: Problem, point: Point) -> NDArray[np.bool_]:
    """Which coordinates are strictly within their bounds, (coordinates,)."""
    vector = point.vector()
    low, high = problem.limits(point)
    return np.asarray((vector > low + 1e-9) & (vector < high - 1e-9))
