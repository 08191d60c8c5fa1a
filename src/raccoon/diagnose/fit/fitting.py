"""Fits by simulation error under coloured noise and priors, from several starts at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import minimise_in_bounds
from raccoon.diagnose.fit.fit_result import Fit, cost_of
from raccoon.diagnose.fit.levenberg_marquardt import Descent, GiveUpRule
from raccoon.diagnose.fit.problem import Point, Problem, neighbouring_points
from raccoon.diagnose.fit.whitener import WhiteningMap

Array = NDArray[np.float64]

MAX_STEPS_WITHOUT_COLUMNS = 9
"""Maximum number of steps of a descent with its present columns, between two linearisations."""
RESIDUALS_AT_ONCE = 128
"""Number of residuals that are whitened together: for 40 s they take some 30 MB."""
PROFILE_STEPS = 4
"""Number of steps of a fit with one coordinate fixed."""


def fit_with_frozen_columns(
    problem: Problem,
    whitener: WhiteningMap,
    starts: Sequence[Point | Fit],
    frozen: Array,
    linearisations: int,
    give_up: GiveUpRule | None = None,
) -> list[Fit]:
    """Fit from every start. frozen (m, rows): whitened columns of the first m coordinates, which are not
    simulated again. Columns of the other coordinates are simulated whenever the last ones predict too badly,
    at most `linearisations` times. give_up: which fits are stopped. A start that is a Fit must be one under
    this whitener; its columns count as simulated."""
    descents = [_descent_from(problem, each) for each in starts]
    for _ in range(linearisations):
        running = [descent for descent in descents if descent.is_running(give_up)]
        if not running:
            break
        running = _needing_columns(problem, whitener, running, give_up)
        if not running:
            continue
        neighbours = [
            (descent, *neighbouring_points(problem, descent.trial, len(frozen))) for descent in running
        ]
        residuals = whitened_residuals(
            problem, whitener, [each for descent, near, _ in neighbours for each in (descent.trial, *near)]
        )
        for descent, _, steps in neighbours:
            residual = next(residuals).copy()  # a view would keep the whole chunk in memory
            jacobian = np.empty((len(frozen) + len(steps), len(residual)))
            jacobian[: len(frozen)] = frozen
            for row, step in enumerate(steps, len(frozen)):
                jacobian[row] = (residual - next(residuals)) / step
            descent.consider(problem, Fit.of(problem, descent.trial, residual, jacobian))
    return [descent.best for descent in descents if descent.best is not None]


def _descent_from(problem: Problem, start: Point | Fit) -> Descent:
    if isinstance(start, Point):
        return Descent(problem.inside(start))
    descent = Descent(start.point)
    descent.consider(problem, start)
    return descent


def whitened_residuals(problem: Problem, whitener: WhiteningMap, points: Sequence[Point]) -> Iterator[Array]:
    """The whitened residual (rows,) of one point after the other, computed as they are consumed."""
    predictions = problem.predictions(points)
    while chunk := list(islice(predictions, RESIDUALS_AT_ONCE)):
        yield from whitener(problem.features.measured - np.stack(chunk))


def costs_at(problem: Problem, whitener: WhiteningMap, points: Sequence[Point]) -> Array:
    """The cost of each point, without any fit, (points,)."""
    whites = whitened_residuals(problem, whitener, points)
    return np.array([cost_of(point, white) for point, white in zip(points, whites, strict=True)])


def _needing_columns(
    problem: Problem, whitener: WhiteningMap, descents: Sequence[Descent], give_up: GiveUpRule | None
) -> list[Descent]:
    """The descents whose trial needs new columns: at their start, or if the trial is better than their best
    point but its gain was not well predicted.

    The others continue with their columns: a third of all trials is no better and is followed by a shorter
    step, and half of the rest is as predicted. Simulating columns takes most of the time.
    """
    found = [descent for descent in descents if descent.best is None]
    running = [descent for descent in descents if descent.best is not None]
    for _ in range(MAX_STEPS_WITHOUT_COLUMNS):
        if not running:
            break
        well_predicted = []
        for descent, residual in zip(
            running, whitened_residuals(problem, whitener, [each.trial for each in running]), strict=True
        ):
            cost = cost_of(descent.trial, residual)
            if descent.is_well_predicted(cost):
                descent.accept_with_updated_columns(problem, residual)
                well_predicted.append(descent)
            elif not descent.is_no_better(cost):
                found.append(descent)
            elif descent.is_misled:
                descent.return_to_best()
                found.append(descent)
            else:
                descent.shorten_step(problem)
        running = [descent for descent in well_predicted if descent.is_running(give_up)]
    return found


def fit_starts(
    problem: Problem,
    whitener: WhiteningMap,
    starts: Sequence[Point | Fit],
    linearisations: int,
    give_up: GiveUpRule | None = None,
) -> list[Fit]:
    """Fit from every start with all columns simulated, at most `linearisations` times."""
    none = np.zeros((0, problem.features.measured.size))
    return fit_with_frozen_columns(problem, whitener, starts, none, linearisations, give_up)


def fit_point(
    problem: Problem,
    whitener: WhiteningMap,
    start: Point | Fit,
    linearisations: int = 10,
    give_up: GiveUpRule | None = None,
) -> Fit:
    """Fit all coordinates from one start until it has converged or is stopped, or its columns were simulated
    `linearisations` times. A start that is a Fit must be one under this whitener; its columns do not
    count."""
    return fit_starts(problem, whitener, [start], linearisations, give_up)[0]


def evaluate_fit(problem: Problem, whitener: WhiteningMap, point: Point) -> Fit:
    """The point, without any fit, as a Fit with its columns under a whitener."""
    return fit_point(problem, whitener, point, 1)


def cost_with_last_held(
    problem: Problem, whitener: WhiteningMap, current: Fit, point: Point, held: Sequence[int]
) -> float:
    """Cost of a fit that starts at a point and keeps its last coordinate fixed (a step of a profile
    likelihood).

    current: the fit without that coordinate, whose columns are used at the point. held: indices of its
    coordinates that are fixed as well.
    """
    moving = np.delete(np.arange(len(current.jacobian)), held)
    columns = current.jacobian[moving]
    low, high = (each[moving] for each in problem.limits(current.point))
    gram, costs = columns @ columns.T + np.eye(len(columns)), []
    for _ in range(PROFILE_STEPS):
        white = whitener(problem.features.measured - problem.predict([point]))[0]
        vector = point.vector()
        costs.append(float(white @ white + vector @ vector))
        free = vector[moving]
        vector[moving] += minimise_in_bounds(gram, columns @ white - free, low - free, high - free)
        point = point.moved(vector)
    return min(costs)
