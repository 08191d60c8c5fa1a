"""Simulation-error fits under coloured noise and priors: Levenberg-Marquardt, several starts at a time.

Minimised is ||w(u)||^2 + ||u||^2: the whitened residual and the prior, both in units of one standard
deviation. The log evidence of the model that was fitted is then, up to a constant, by Laplace's method

    -1/2 (||w||^2 + ||u||^2) - 1/2 log det(1 + J J')
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.evidence import bounded_least
from raccoon.diagnose.problem import Point, Problem, Whitening, neighbours

Array = NDArray[np.float64]
Lost = Callable[["Fit", float], bool]
"""Whether a fit whose cost is foretold to fall by so much in its next step is given up."""


@dataclass(frozen=True, slots=True)
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

    @property
    def sound(self) -> bool:
        """Whether the simulation gave numbers, at the point and a step away from it."""
        return bool(np.isfinite(self.cost) and np.isfinite(self.jacobian).all())

    @property
    def evidence(self) -> float:
        """Log evidence, comparable between fits under the same whitener."""
        if not self.sound:
            return -np.inf
        gram = self.jacobian @ self.jacobian.T
        _, logdet = np.linalg.slogdet(np.eye(len(gram)) + gram)
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
SHORTER = 0.3
"""Part of a step that is tried next where the whole of it made things worse."""
AT_ONCE = 128
"""Residuals that are whitened together: of 40 s they take some 30 MB."""
HELD_STEPS = 4
"""Steps of a fit of which one coordinate stays."""


@dataclass(slots=True)
class _Track:
    """One start on its way: the best so far, where it goes next, how carefully, whether it has arrived.

    foretold: by how much the linear model says that the cost falls from the best to the trial.
    """

    trial: Point
    best: Fit | None = None
    damping: float = 0.01
    arrived: bool = False
    foretold: float = np.inf

    def is_no_better(self, cost: float) -> bool:
        """Whether the trial, which costs that, is not below the best so far."""
        return self.best is not None and cost >= self.best.cost

    def is_lost(self, lost: Lost | None) -> bool:
        """Whether going on is in vain."""
        return lost is not None and self.best is not None and lost(self.best, self.foretold)

    def shorten(self, problem: Problem) -> None:
        """Go less far next, after a trial that is no better."""
        self._scale_step(problem, SHORTER)
        self.foretold *= 1.0 - (1.0 - SHORTER) ** 2
        self.damping = min(self.damping * 8.0, 1e6)
        self.arrived = self.foretold < ROUGH

    def consider(self, problem: Problem, fit: Fit) -> None:
        """Go on from the trial, which this is with its columns, or go less far."""
        if self.is_no_better(fit.cost):
            self.shorten(problem)
            return
        if not fit.sound:
            self.best, self.arrived = self.best or fit, True
            return
        reach = 1.0
        if self.best is not None:
            decrease = self.best.cost - fit.cost
            self.arrived = decrease < max(SETTLED, min(ROUGH, STALLED * self.foretold))
            reach = _reach(decrease / max(self.foretold, SETTLED))
        self.best = fit
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
    plain = fit.jacobian @ fit.jacobian.T + np.eye(len(vector))
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
    iterations: int,
    lost: Lost | None = None,
) -> list[Fit]:
    """Fit every start. frozen (m, rows): whitened columns of the first m coordinates, taken as they are;
    columns of later coordinates are simulated anew in every iteration. lost: which are left as they are."""
    tracks = [_Track(problem.inside(each)) for each in starts]
    for _ in range(iterations):
        going = [track for track in tracks if not (track.arrived or track.is_lost(lost))]
        if not going:
            break
        going = _promising(problem, whitener, going)
        if not going:
            continue
        looks = [(track, *neighbours(problem, track.trial, len(frozen))) for track in going]
        white = whitened(
            problem, whitener, [each for track, near, _ in looks for each in (track.trial, *near)]
        )
        for track, _, steps in looks:
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


def _promising(problem: Problem, whitener: Whitening, tracks: Sequence[_Track]) -> list[_Track]:
    """Those at their start or with a trial better than what they have; the others go less far next.

    A third of all trials is no better: their columns, which is what takes time, need no simulation.
    """
    begun = [track for track in tracks if track.best is not None]
    if not begun:
        return list(tracks)
    trials = [track.trial for track in begun]
    white = whitened(problem, whitener, trials)
    costs = {id(track): cost_of(track.trial, own) for track, own in zip(begun, white, strict=True)}
    found = []
    for track in tracks:
        if track.is_no_better(costs.get(id(track), 0.0)):
            track.shorten(problem)
        else:
            found.append(track)
    return found


def fit_afresh(
    problem: Problem,
    whitener: Whitening,
    starts: Sequence[Point],
    iterations: int,
    lost: Lost | None = None,
) -> list[Fit]:
    """Fit every start, all columns simulated in every iteration."""
    none = np.zeros((0, problem.features.measured.size))
    return fit_many(problem, whitener, starts, none, iterations, lost)


def fit_point(
    problem: Problem, whitener: Whitening, start: Point, iterations: int = 10, lost: Lost | None = None
) -> Fit:
    """Fit everything from one start, all columns simulated in every iteration, until it has arrived or is
    lost."""
    return fit_afresh(problem, whitener, [start], iterations, lost)[0]


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
