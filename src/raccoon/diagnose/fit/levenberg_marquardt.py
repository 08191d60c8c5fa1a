"""A Levenberg-Marquardt descent of a fit from one start to a minimum of its cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import minimise_in_bounds
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.problem import Point, Problem

Array = NDArray[np.float64]
GiveUpRule = Callable[[Fit, float], bool]
"""Whether to stop a fit, given its best point so far and the cost decrease predicted for its next step."""

CONVERGED_DECREASE = 0.05
"""Decrease of the cost, in an iteration or predicted for the next, below which a fit has converged."""
ROUGH_DECREASE = 1.0
"""The same after a step that did not bring its predicted decrease: where wheels break loose the cost is
rough."""
STALLED_RATIO = 0.1
"""Share of the predicted decrease below which a decrease of up to ROUGH_DECREASE counts as converged."""
MAX_STEP_FACTOR = 2.0
"""Largest factor by which a step is lengthened if columns turned out too steep, as they are at kinks."""
GOOD_GAIN_RATIOS = (0.6, 1.6)
"""Gain ratios (decrease of the cost over the predicted one) between which the columns, with a Broyden update,
are reused for the next step: a step then takes one simulation instead of thirty."""
STALE_DECREASE = 20.0
"""Threshold on the decrease of the cost that updated columns predicted wrongly, above which they are
simulated anew."""
STEP_REDUCTION = 0.3
"""Share of a step that is tried next if the whole step did not lower the cost."""


@dataclass(slots=True)
class Descent:
    """A Levenberg-Marquardt descent from one start: its best fit so far, its next trial, damping,
    convergence.

    predicted_decrease: of the cost from the best fit to the trial, by the linear model. has_updated_columns:
    whether the columns of the best fit are Broyden updates of an earlier point's columns, not simulated.
    """

    trial: Point
    best: Fit | None = None
    damping: float = 0.01
    converged: bool = False
    predicted_decrease: float = np.inf
    has_updated_columns: bool = False

    def is_no_better(self, cost: float) -> bool:
        """Whether the trial, with this cost, is not below the best fit so far."""
        return self.best is not None and cost >= self.best.cost

    def should_give_up(self, give_up: GiveUpRule | None) -> bool:
        """Whether the rule stops the descent."""
        return give_up is not None and self.best is not None and give_up(self.best, self.predicted_decrease)

    def is_running(self, give_up: GiveUpRule | None) -> bool:
        """Whether the descent has neither converged nor been stopped."""
        return not (self.converged or self.should_give_up(give_up))

    def shorten_step(self, problem: Problem) -> None:
        """Shorten the next step, after a trial that is no better."""
        self._scale_step(problem, STEP_REDUCTION)
        self.predicted_decrease *= 1.0 - (1.0 - STEP_REDUCTION) ** 2
        self.damping = min(self.damping * 8.0, 1e6)
        self.converged = self.predicted_decrease < ROUGH_DECREASE

    def is_well_predicted(self, cost: float) -> bool:
        """Whether the best fit's columns predicted the gain of the trial, with this cost, well."""
        if self.best is None:
            return False
        low, high = GOOD_GAIN_RATIOS
        return low * self.predicted_decrease < self.best.cost - cost < high * self.predicted_decrease

    @property
    def is_misled(self) -> bool:
        """Whether updated columns predicted a large decrease and the trial is no better."""
        return self.has_updated_columns and self.predicted_decrease > STALE_DECREASE

    def accept_with_updated_columns(self, problem: Problem, white: Array) -> None:
        """Continue from the trial, with this whitened residual, and the best fit's columns updated
        (Broyden)."""
        assert self.best is not None
        self.consider(problem, _broyden_update(problem, self.best, self.trial, white), updated=True)

    def return_to_best(self) -> None:
        """Make the best point the next trial, so that its columns are simulated."""
        assert self.best is not None
        self.trial, self.has_updated_columns, self.predicted_decrease = self.best.point, False, np.inf

    def consider(self, problem: Problem, fit: Fit, updated: bool = False) -> None:
        """Accept the trial's fit and plan the next step from it, or shorten the step if it is no better.

        updated: whether its columns are a Broyden update.
        """
        previous = None if self.best is None or self.best.point is fit.point else self.best
        if previous is not None and self.is_no_better(fit.cost):
            self.shorten_step(problem)
            return
        if not fit.is_finite:
            self.best, self.converged = self.best or fit, True
            return
        factor = 1.0
        if previous is not None:
            decrease = previous.cost - fit.cost
            self.converged = decrease < max(
                CONVERGED_DECREASE, min(ROUGH_DECREASE, STALLED_RATIO * self.predicted_decrease)
            )
            gain_ratio = decrease / max(self.predicted_decrease, CONVERGED_DECREASE)
            factor = 1.0 if updated else _step_factor(gain_ratio)
        self.best, self.has_updated_columns = fit, updated
        self.damping = max(self.damping / 5.0, 1e-6)
        self.trial, self.predicted_decrease = _damped_step(problem, fit, self.damping)
        if factor > 1.0:
            self._scale_step(problem, factor)
        self.converged |= self.predicted_decrease < CONVERGED_DECREASE

    def _scale_step(self, problem: Problem, factor: float) -> None:
        assert self.best is not None
        start = self.best.point.vector()
        end = start + factor * (self.trial.vector() - start)
        self.trial = problem.inside(self.best.point.moved(end))


def _broyden_update(problem: Problem, fit: Fit, point: Point, white: Array) -> Fit:
    """A fit at a point near another one, with the other's columns corrected such that they predict the step
    between the two (Broyden 1965). Each is corrected by a share of the prediction error in proportion to its
    part in the step."""
    step = point.vector() - fit.point.vector()
    missed = fit.whitened_residual - white - step @ fit.jacobian
    share = step * (np.diag(fit.curvature) - 1.0)
    return Fit.of(problem, point, white, fit.jacobian + np.outer(share / (step @ share), missed))


def _step_factor(ratio: float) -> float:
    """Factor by which to lengthen the next step after one that lowered the cost `ratio` times as much as
    predicted.

    If columns are c times too steep, steps are c times too short and the ratio is 2 - 1/c.
    """
    return float(np.clip(1.0 / max(2.0 - ratio, 1e-9), 1.0, MAX_STEP_FACTOR))


def _damped_step(problem: Problem, fit: Fit, damping: float) -> tuple[Point, float]:
    """The point after a damped Gauss-Newton step, and the cost decrease that the linear model predicts.

    The step stays within the bounds: a coordinate whose optimum is out of bounds goes to its bound, and the
    others to their optimum given that.
    """
    vector = fit.point.vector()
    low, high = problem.limits(fit.point)
    plain = fit.curvature
    gram = plain + damping * np.diag(np.diag(plain))
    gradient = fit.jacobian @ fit.whitened_residual - vector
    step = minimise_in_bounds(gram, gradient, low - vector, high - vector)
    moved = np.clip(vector + step, low, high)
    step = moved - vector
    return fit.point.moved(moved), float(2.0 * gradient @ step - step @ plain @ step)
