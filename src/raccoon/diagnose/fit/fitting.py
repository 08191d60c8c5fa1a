"""Simulation-error fits under coloured noise and priors, several starts at a time."""

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
"""Most steps that a start takes with the columns that it has, between two looks at all of them."""
RESIDUALS_AT_ONCE = 128
"""Residuals that are whitened together: of 40 s they take some 30 MB."""
PROFILE_STEPS = 4
"""Steps of a fit of which one coordinate stays."""


def fit_with_frozen_columns(
    problem: Problem,
    whitener: WhiteningMap,
    starts: Sequence[Point | Fit],
    frozen: Array,
    linearisations: int,
    give_up: GiveUpRule | None = None,
) -> list[Fit]:
    """Fit every start. frozen (m, rows): whitened columns of the first m coordinates, taken as they are;
    columns of later coordinates are simulated where the last ones no longer do, `looks` times at most. lost:
    which are left as they are. A start that is a fit under this whitener has its columns, all simulated."""
    descents = [_descent_from(problem, each) for each in starts]
    for _ in range(linearisations):
        going = [track for track in descents if track.is_running(give_up)]
        if not going:
            break
        going = _needing_columns(problem, whitener, going, give_up)
        if not going:
            continue
        seen = [(track, *neighbouring_points(problem, track.trial, len(frozen))) for track in going]
        white = whitened_residuals(
            problem, whitener, [each for track, near, _ in seen for each in (track.trial, *near)]
        )
        for descent, _, steps in seen:
            own = next(white).copy()  # not with all that was whitened beside it
            jacobian = np.empty((len(frozen) + len(steps), len(own)))
            jacobian[: len(frozen)] = frozen
            for row, step in enumerate(steps, len(frozen)):
                jacobian[row] = (own - next(white)) / step
            descent.consider(problem, Fit.of(problem, descent.trial, own, jacobian))
    return [track.best for track in descents if track.best is not None]


def _descent_from(problem: Problem, start: Point | Fit) -> Descent:
    if isinstance(start, Point):
        return Descent(problem.inside(start))
    track = Descent(start.point)
    track.consider(problem, start)
    return track


def whitened_residuals(problem: Problem, whitener: WhiteningMap, points: Sequence[Point]) -> Iterator[Array]:
    """The whitened residual (rows,) of one point after the other: of many points not all are in memory."""
    predictions = problem.predictions(points)
    while some := list(islice(predictions, RESIDUALS_AT_ONCE)):
        yield from whitener(problem.features.measured - np.stack(some))


def costs_at(problem: Problem, whitener: WhiteningMap, points: Sequence[Point]) -> Array:
    """What each point costs as it is, (points,)."""
    whites = whitened_residuals(problem, whitener, points)
    return np.array([cost_of(point, white) for point, white in zip(points, whites, strict=True)])


def _needing_columns(
    problem: Problem, whitener: WhiteningMap, descents: Sequence[Descent], give_up: GiveUpRule | None
) -> list[Descent]:
    """Those whose trial needs columns: at their start, or better than what they have and not as foretold.

    The others go on with the columns that they have: a third of all trials is no better, and goes less far
    next, and half of the rest is as foretold. Columns are what takes time.
    """
    found = [track for track in descents if track.best is None]
    running = [track for track in descents if track.best is not None]
    for _ in range(MAX_STEPS_WITHOUT_COLUMNS):
        if not running:
            break
        straight = []
        for descent, own in zip(
            running, whitened_residuals(problem, whitener, [each.trial for each in running]), strict=True
        ):
            cost = cost_of(descent.trial, own)
            if descent.is_well_predicted(cost):
                descent.accept_with_updated_columns(problem, own)
                straight.append(descent)
            elif not descent.is_no_better(cost):
                found.append(descent)
            elif descent.is_misled:
                descent.return_to_best()
                found.append(descent)
            else:
                descent.shorten_step(problem)
        running = [track for track in straight if track.is_running(give_up)]
    return found


def fit_starts(
    problem: Problem,
    whitener: WhiteningMap,
    starts: Sequence[Point | Fit],
    linearisations: int,
    give_up: GiveUpRule | None = None,
) -> list[Fit]:
    """Fit every start, all columns simulated: so many times at most."""
    none = np.zeros((0, problem.features.measured.size))
    return fit_with_frozen_columns(problem, whitener, starts, none, linearisations, give_up)


def fit_point(
    problem: Problem,
    whitener: WhiteningMap,
    start: Point | Fit,
    linearisations: int = 10,
    give_up: GiveUpRule | None = None,
) -> Fit:
    """Fit everything from one start until it has arrived or is lost, or its columns were simulated so many
    times. A start that is a fit under this whitener has its columns, which are not counted."""
    return fit_starts(problem, whitener, [start], linearisations, give_up)[0]


def evaluate_fit(problem: Problem, whitener: WhiteningMap, point: Point) -> Fit:
    """The point as it is, with its columns, under a whitener."""
    return fit_point(problem, whitener, point, 1)


def cost_with_last_held(
    problem: Problem, whitener: WhiteningMap, settled: Fit, point: Point, held: Sequence[int]
) -> float:
    """What a fit costs whose last coordinate stays, all others going from a point to where they are best.

    settled: the fit without it, whose columns are as good as those of the point. held: coordinates of it that
    stay as well.
    """
    moving = np.delete(np.arange(len(settled.jacobian)), held)
    columns = settled.jacobian[moving]
    low, high = (each[moving] for each in problem.limits(settled.point))
    gram, costs = columns @ columns.T + np.eye(len(columns)), []
    for _ in range(PROFILE_STEPS):
        white = whitener(problem.features.measured - problem.predict([point]))[0]
        vector = point.vector()
        costs.append(float(white @ white + vector @ vector))
        own = vector[moving]
        vector[moving] += minimise_in_bounds(gram, columns @ white - own, low - own, high - own)
        point = point.moved(vector)
    return min(costs)
