"""Simulation-error fits under coloured noise and priors: Levenberg-Marquardt, several starts at a time.

Minimised is ||w(u)||^2 + ||u||^2: the whitened residual and the prior, both in units of one standard
deviation. The log evidence of the model that was fitted is then, up to a constant, by Laplace's method

    -1/2 (||w||^2 + ||u||^2) - 1/2 log det(1 + J J')
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.evidence import bounded_least
from raccoon.diagnose.problem import Point, Problem, Whitening, neighbours

Array = NDArray[np.float64]
Lost = Callable[["Fit", float], bool]
"""Whether a fit whose cost is foretold to fall by so much in its next step is given up."""


@dataclass(frozen=True)
class Fit:
    """A fitted point. white (rows,): its whitened residual. jacobian (coordinates, rows): whitened
    columns. free: coordinates that are not
    held at a bound."""

    point: Point
    white: Array
    jacobian: Array
    cost: float
    free: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem, point: Point, white: Array, jacobian: Array) -> Fit:
        """With its cost, and what is free."""
        return cls(point, white, jacobian, cost_of(point, white), unbound(problem, point))

    @cached_property
    def curvature(self) -> Array:
        """1 + J J', that of half the cost."""
        return np.asarray(self.jacobian @ self.jacobian.T + np.eye(len(self.jacobian)), float)

    @property
    def sound(self) -> bool:
        """Whether the simulation gave numbers, at the point and a step away from it."""
        return bool(np.isfinite(self.cost) and np.isfinite(np.diag(self.curvature)).all())

    @cached_property
    def evidence(self) -> float:
        """Log evidence, comparable between fits under the same whitener."""
        if not self.sound:
            return -np.inf
        _, logdet = np.linalg.slogdet(self.curvature)
        return float(-0.5 * self.cost - 0.5 * logdet)

    @property
    def target(self) -> Array:
        """What the free columns must explain, counted from u = 0."""
        free = self.free
        return np.asarray(self.white + self.point.vector()[free] @ self.jacobian[free], float)


def cost_of(point: Point, white: Array) -> float:
    """What a point costs whose whitened residual this is; where the simulation gives no numbers more than any
    other."""
    vector = point.vector()
    cost = float(white @ white + vector @ vector)
    return cost if np.isfinite(cost) else np.inf


def unbound(problem: Problem, point: Point) -> NDArray[np.bool_]:
    """Which coordinates are inside their bounds."""
    vector = point.vector()
    low, high = problem.limits(point)
    return np.asarray((vector > low + 1e-9) & (vector < high - 1e-9))


SETTLED = 0.05
"""Decrease of the cost, in an iteration or foretold for the next, from which a fit has arrived."""
ROUGH = 1.0
"""The same for a step that was foretold to help and did not: where wheels break loose the cost is rough."""
STALLED = 0.1
"""Part of what was foretold below which so small a decrease is no progress."""
FARTHEST = 2.0
"""Most by which a step is lengthened where columns turned out too steep, as kinks make them."""
STRAIGHT = (0.6, 1.6)
"""Decrease of the cost, over what was foretold, between which the columns that led there do for the next
step as well, bent by what they missed: a step then takes one simulation instead of thirty."""
STRAIGHT_ON = 9
"""Most such steps between two looks at all columns."""
STALE = 20.0
"""Decrease of the cost that bent columns foretold in vain, from which they are simulated anew."""
SHORTER = 0.3
"""Part of a step that is tried next where the whole of it made things worse."""
AT_ONCE = 128
"""Residuals that are whitened together: of 40 s they take some 30 MB."""
HELD_STEPS = 4
"""Steps of a fit of which one coordinate stays."""


@dataclass(slots=True)
class _Track:
    """One start on its way: the best so far, where it goes next, how carefully, whether it has arrived.

    foretold: by how much the linear model says that the cost falls from the best to the trial. bent: whether
    the columns of the best are those of a point before it, bent.
    """

    trial: Point
    best: Fit | None = None
    damping: float = 0.01
    arrived: bool = False
    foretold: float = np.inf
    bent: bool = False

    def is_no_better(self, cost: float) -> bool:
        """Whether the trial, which costs that, is not below the best so far."""
        return self.best is not None and cost >= self.best.cost

    def is_lost(self, lost: Lost | None) -> bool:
        """Whether going on is in vain."""
        return lost is not None and self.best is not None and lost(self.best, self.foretold)

    def is_going(self, lost: Lost | None) -> bool:
        """Whether there is a trial left that is worth it."""
        return not (self.arrived or self.is_lost(lost))

    def shorten(self, problem: Problem) -> None:
        """Go less far next, after a trial that is no better."""
        self._scale_step(problem, SHORTER)
        self.foretold *= 1.0 - (1.0 - SHORTER) ** 2
        self.damping = min(self.damping * 8.0, 1e6)
        self.arrived = self.foretold < ROUGH

    def is_straight(self, cost: float) -> bool:
        """Whether the best's columns foretold well what the trial, which costs that, gains."""
        if self.best is None:
            return False
        low, high = STRAIGHT
        return low * self.foretold < self.best.cost - cost < high * self.foretold

    def look_again(self) -> None:
        """Make the best the trial, to have its columns simulated after all."""
        assert self.best is not None
        self.trial, self.bent, self.foretold = self.best.point, False, np.inf

    def consider(self, problem: Problem, fit: Fit, bent: bool = False) -> None:
        """Go on from the trial, which this is with its columns, or go less far."""
        before = None if self.best is None or self.best.point is fit.point else self.best
        if before is not None and self.is_no_better(fit.cost):
            self.shorten(problem)
            return
        if not fit.sound:
            self.best, self.arrived = self.best or fit, True
            return
        reach = 1.0
        if before is not None:
            decrease = before.cost - fit.cost
            self.arrived = decrease < max(SETTLED, min(ROUGH, STALLED * self.foretold))
            reach = 1.0 if bent else _reach(decrease / max(self.foretold, SETTLED))
        self.best, self.bent = fit, bent
        self.damping = max(self.damping / 5.0, 1e-6)
        self.trial, self.foretold = _step(problem, fit, self.damping)
        if reach > 1.0:
            self._scale_step(problem, reach)
        self.arrived |= self.foretold < SETTLED

    def _scale_step(self, problem: Problem, factor: float) -> None:
        assert self.best is not None
        start = self.best.point.vector()
        end = start + factor * (self.trial.vector() - start)
        self.trial = problem.inside(self.best.point.moved(end))


def _bent(problem: Problem, fit: Fit, point: Point, white: Array) -> Fit:
    """A fit at a point near another, with the columns of that one bent so that they foretell the step between
    the two (Broyden 1965): each by a share of what was missed, as large as its own part in the step."""
    step = point.vector() - fit.point.vector()
    missed = fit.white - white - step @ fit.jacobian
    share = step * (np.diag(fit.curvature) - 1.0)
    return Fit.of(problem, point, white, fit.jacobian + np.outer(share / (step @ share), missed))


def _reach(ratio: float) -> float:
    """By how much to lengthen the next step after one that lowered the cost `ratio` times as foretold.

    Where columns are c times too steep, steps are c times too short and the ratio is 2 - 1/c.
    """
    return float(np.clip(1.0 / max(2.0 - ratio, 1e-9), 1.0, FARTHEST))


def _step(problem: Problem, fit: Fit, damping: float) -> tuple[Point, float]:
    """Damped Gauss-Newton step, and the decrease of the cost that the linear model foretells.

    It is kept inside the bounds: a coordinate that would leave goes as far as its bound, and the others to
    where they are best beside it.
    """
    vector = fit.point.vector()
    low, high = problem.limits(fit.point)
    plain = fit.curvature
    gram = plain + damping * np.diag(np.diag(plain))
    gradient = fit.jacobian @ fit.white - vector
    step = bounded_least(gram, gradient, low - vector, high - vector)
    moved = np.clip(vector + step, low, high)
    step = moved - vector
    return fit.point.moved(moved), float(2.0 * gradient @ step - step @ plain @ step)


def fit_many(
    problem: Problem,
    whitener: Whitening,
    starts: Sequence[Point],
    frozen: Array,
    looks: int,
    lost: Lost | None = None,
) -> list[Fit]:
    """Fit every start. frozen (m, rows): whitened columns of the first m coordinates, taken as they are;
    columns of later coordinates are simulated where the last ones no longer do, `looks` times at most. lost:
    which are left as they are."""
    tracks = [_Track(problem.inside(each)) for each in starts]
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


def whitened(problem: Problem, whitener: Whitening, points: Sequence[Point]) -> Iterator[Array]:
    """The whitened residual (rows,) of one point after the other: of many points not all are in memory."""
    predictions = problem.predictions(points)
    while some := list(islice(predictions, AT_ONCE)):
        yield from whitener(problem.features.measured - np.stack(some))


def _turning(
    problem: Problem, whitener: Whitening, tracks: Sequence[_Track], lost: Lost | None
) -> list[_Track]:
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
            assert track.best is not None
            cost = cost_of(track.trial, own)
            if track.is_straight(cost):
                track.consider(problem, _bent(problem, track.best, track.trial, own), bent=True)
                straight.append(track)
            elif not track.is_no_better(cost):
                found.append(track)
            elif track.bent and track.foretold > STALE:
                track.look_again()
                found.append(track)
            else:
                track.shorten(problem)
        begun = [track for track in straight if track.is_going(lost)]
    return found


def fit_afresh(
    problem: Problem,
    whitener: Whitening,
    starts: Sequence[Point],
    looks: int,
    lost: Lost | None = None,
) -> list[Fit]:
    """Fit every start, all columns simulated: so many times at most."""
    none = np.zeros((0, problem.features.measured.size))
    return fit_many(problem, whitener, starts, none, looks, lost)


def fit_point(
    problem: Problem, whitener: Whitening, start: Point, looks: int = 10, lost: Lost | None = None
) -> Fit:
    """Fit everything from one start until it has arrived or is lost, or its columns were simulated so many
    times."""
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
