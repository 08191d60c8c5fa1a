"""The way of a fit from one start down to where its cost is least: Levenberg-Marquardt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import bounded_least
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.problem import Point, Problem

Array = NDArray[np.float64]
Lost = Callable[[Fit, float], bool]
"""Whether a fit whose cost is foretold to fall by so much in its next step is given up."""

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
STALE = 20.0
"""Decrease of the cost that bent columns foretold in vain, from which they are simulated anew."""
SHORTER = 0.3
"""Part of a step that is tried next where the whole of it made things worse."""


@dataclass(slots=True)
class Track:
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

    @property
    def is_misled(self) -> bool:
        """Whether bent columns foretold more than they may where the trial is no better."""
        return self.bent and self.foretold > STALE

    def go_straight(self, problem: Problem, white: Array) -> None:
        """Go on from the trial, which leaves that whitened residual, with the best's columns bent."""
        assert self.best is not None
        self.consider(problem, _bent(problem, self.best, self.trial, white), bent=True)

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
