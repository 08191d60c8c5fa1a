"""Simulation-error fits under coloured noise and priors, several starts at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import bounded_least
from raccoon.diagnose.fit.fit_result import Fit, cost_of
from raccoon.diagnose.fit.levenberg_marquardt import Lost, Track
from raccoon.diagnose.fit.problem import Point, Problem, neighbours
from raccoon.diagnose.fit.whitener import Whitening

Array = NDArray[np.float64]

STRAIGHT_ON = 9
"""Most steps that a start takes with the columns that it has, between two looks at all of them."""
AT_ONCE = 128
"""Residuals that are whitened together: of 40 s they take some 30 MB."""
HELD_STEPS = 4
"""Steps of a fit of which one coordinate stays."""


def fit_many(
    problem: Problem,
    whitener: Whitening,
    starts: Sequence[Point | Fit],
    frozen: Array,
    looks: int,
    lost: Lost | None = None,
) -> list[Fit]:
    """Fit every start. frozen (m, rows): whitened columns of the first m coordinates, taken as they are;
    columns of later coordinates are simulated where the last ones no longer do, `looks` times at most. lost:
    which are left as they are. A start that is a fit under this whitener has its columns, all simulated."""
    tracks = [_track(problem, each) for each in starts]
    for _ in range(looks):
        going = [track for track in tracks if track.is_going(lost)]
        if not going:
            break
        going = _turning(problem, whitener, going, lost)
        if not going:
            continue
        seen = [(track, *neighbours(problem, track.trial, len(frozen))) for track in going]
        white = whitened(
            problem, whitener, [each for track, near, _ in seen for each in (track.trial, *near)]
        )
        for track, _, steps in seen:
            own = next(white).copy()  # not with all that was whitened beside it
            jacobian = np.empty((len(frozen) + len(steps), len(own)))
            jacobian[: len(frozen)] = frozen
            for row, step in enumerate(steps, len(frozen)):
                jacobian[row] = (own - next(white)) / step
            track.consider(problem, Fit.of(problem, track.trial, own, jacobian))
    return [track.best for track in tracks if track.best is not None]


def _track(problem: Problem, start: Point | Fit) -> Track:
    if isinstance(start, Point):
        return Track(problem.inside(start))
    track = Track(start.point)
    track.consider(problem, start)
    return track


def whitened(problem: Problem, whitener: Whitening, points: Sequence[Point]) -> Iterator[Array]:
    """The whitened residual (rows,) of one point after the other: of many points not all are in memory."""
    predictions = problem.predictions(points)
    while some := list(islice(predictions, AT_ONCE)):
        yield from whitener(problem.features.measured - np.stack(some))


def costs_at(problem: Problem, whitener: Whitening, points: Sequence[Point]) -> Array:
    """What each point costs as it is, (points,)."""
    whites = whitened(problem, whitener, points)
    return np.array([cost_of(point, white) for point, white in zip(points, whites, strict=True)])


def _turning(
    problem: Problem, whitener: Whitening, tracks: Sequence[Track], lost: Lost | None
) -> list[Track]:
    """Those whose trial needs columns: at their start, or better than what they have and not as foretold.

    The others go on with the columns that they have: a third of all trials is no better, and goes less far
    next, and half of the rest is as foretold. Columns are what takes time.
    """
    found = [track for track in tracks if track.best is None]
    begun = [track for track in tracks if track.best is not None]
    for _ in range(STRAIGHT_ON):
        if not begun:
            break
        straight = []
        for track, own in zip(
            begun, whitened(problem, whitener, [each.trial for each in begun]), strict=True
        ):
            cost = cost_of(track.trial, own)
            if track.is_straight(cost):
                track.go_straight(problem, own)
                straight.append(track)
            elif not track.is_no_better(cost):
                found.append(track)
            elif track.is_misled:
                track.look_again()
                found.append(track)
            else:
                track.shorten(problem)
        begun = [track for track in straight if track.is_going(lost)]
    return found


def fit_afresh(
    problem: Problem,
    whitener: Whitening,
    starts: Sequence[Point | Fit],
    looks: int,
    lost: Lost | None = None,
) -> list[Fit]:
    """Fit every start, all columns simulated: so many times at most."""
    none = np.zeros((0, problem.features.measured.size))
    return fit_many(problem, whitener, starts, none, looks, lost)


def fit_point(
    problem: Problem, whitener: Whitening, start: Point | Fit, looks: int = 10, lost: Lost | None = None
) -> Fit:
    """Fit everything from one start until it has arrived or is lost, or its columns were simulated so many
    times. A start that is a fit under this whitener has its columns, which are not counted."""
    return fit_afresh(problem, whitener, [start], looks, lost)[0]


def fit_at(problem: Problem, whitener: Whitening, point: Point) -> Fit:
    """The point as it is, with its columns, under a whitener."""
    return fit_point(problem, whitener, point, 1)


def cost_with_last_held(
    problem: Problem, whitener: Whitening, settled: Fit, point: Point, held: Sequence[int]
) -> float:
    """What a fit costs whose last coordinate stays, all others going from a point to where they are best.

    settled: the fit without it, whose columns are as good as those of the point. held: coordinates of it that
    stay as well.
    """
    moving = np.delete(np.arange(len(settled.jacobian)), held)
    columns = settled.jacobian[moving]
    low, high = (each[moving] for each in problem.limits(settled.point))
    gram, costs = columns @ columns.T + np.eye(len(columns)), []
    for _ in range(HELD_STEPS):
        white = whitener(problem.features.measured - problem.predict([point]))[0]
        vector = point.vector()
        costs.append(float(white @ white + vector @ vector))
        own = vector[moving]
        vector[moving] += bounded_least(gram, columns @ white - own, low - own, high - own)
        point = point.moved(vector)
    return min(costs)
