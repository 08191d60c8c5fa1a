"""How sure the numbers of a fit are."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.findings.floor_friction import without_floor_friction
from raccoon.diagnose.fit.fitting import costs_at
from raccoon.diagnose.hypotheses.coordinates import Setting, Settings
from raccoon.diagnose.rollout.encoder_window import WINDOW
from raccoon.diagnose.select.fit_comparison import block_grams
from raccoon.diagnose.select.refits import SEVERAL_CAUSES
from raccoon.diagnose.select.state import Search

Array = NDArray[np.float64]

LATENCY = "actuation.latency"
COORDINATE_STEP = 1e-4
"""Units of a coordinate, over which settings are differentiated by it."""
MIN_STAIR_STEP = 0.05
"""Steps of coordinates from which their misfit, seen closely, is a staircase: a gap that is crossed between
two samples of the gyro may be a little wider, and no reading changes."""
MAX_FLAT_NORM = 3.0
"""Norm of such a column below which the step from the fit tells nothing."""
NOISE_LEARNING_S = 10.0
"""s of driving after which the size of the noise is learnt: on shorter drives numbers scatter by more than it
says, as noise that is learnt from few moments is too small."""
UNNAMED_CAUSE_WIDTH = 0.05
"""Standard deviation, in prior widths, of each cause that is not named, where several are."""
TRIED_WIDTHS = (0.01, 0.02, 0.035, 0.06, 0.1, 0.18, 0.3, 0.55, 1.0)
"""Widths from the fit at which such a coordinate is tried: one standard deviation is where the cost has risen
by 1."""


@dataclass(frozen=True, slots=True)
class FitUncertainty:
    """Settings at a fit, a step along each coordinate from it, and the covariance of the coordinates.

    row_s: s of a row of what encoders read, else 0. The age of their words, and of the gyro's, is known no
    better than to a row, and so is the latency of commands.
    """

    settings: Settings
    moved_settings: tuple[Settings, ...]
    covariance: Array
    row_s: float = 0.0

    @classmethod
    def of(cls, search: Search) -> FitUncertainty:
        """Of the fit with which a search ended."""
        problem = search.problem
        point = without_floor_friction(problem, search.fit.point, search.whitener.wander_share)
        vector = point.vector()
        steps = COORDINATE_STEP * np.eye(len(vector))
        moved = tuple(problem.settings(point.moved(vector + step)) for step in steps)
        row = problem.neutral.get(WINDOW, 0.0)
        return cls(problem.settings(point), moved, coordinate_covariance(search), row)

    def value_of(self, key: Setting) -> float:
        """A setting at the fit; an inertia with what robot.toml leaves open of it."""
        return setting_value(self.settings, key)

    def std(self, key: Setting) -> float:
        """Its standard deviation, by the chain rule through every coordinate; 0 for one that was not
        fitted."""
        value = self.value_of(key)
        slope = np.array(
            [(setting_value(other, key) - value) / COORDINATE_STEP for other in self.moved_settings]
        )
        slope = np.where(np.isfinite(slope), slope, 0.0)
        std = math.sqrt(max(float(slope @ self.covariance @ slope), 0.0))
        return math.hypot(std, self.row_s / math.sqrt(12.0)) if std > 0.0 and key[0] == LATENCY else std


def coordinate_covariance(search: Search) -> Array:
    """Covariance of all coordinates: the curvature's, widened where blocks of time disagree more than it
    says.

    Sandwich estimate H^-1 (sum_b g_b g_b') H^-1 of White (1982) over blocks; with few blocks it is noisy, so
    only its mean ratio to the curvature's variance is used, and only where it is above 1. It is of what is
    free alone: where what is held at a bound acts like a coordinate that is free, blocks would seem to
    disagree several hundred times as much as they do. And widened the more the shorter a recording is, and by
    what is not named where several causes are.
    """
    fit = search.fit
    columns = fit.jacobian
    hessian = columns @ columns.T + np.eye(len(columns)) + np.diag(_stair_curvature(search))
    unnamed = _unnamed_responses(search)
    across = unnamed @ columns.T
    with_unnamed = hessian - across.T @ np.linalg.solve(np.eye(len(unnamed)) + unnamed @ unnamed.T, across)
    free = np.flatnonzero(fit.free)
    blocks = block_grams(fit)
    mean, _, _ = reduce(add, blocks).solve()
    scores = np.stack([each.projection - each.matrix @ mean for each in blocks])
    inner = np.linalg.inv(hessian[np.ix_(free, free)])
    sandwich = inner @ (scores.T @ scores) @ inner
    ratio = float(np.mean(np.diag(sandwich) / np.diag(inner)))
    features = search.problem.features
    widened = np.asarray(np.linalg.inv(with_unnamed), float)
    return widened * max(1.0, ratio) * (1.0 + NOISE_LEARNING_S / (len(features.time) * features.width))


def _unnamed_responses(search: Search) -> Array:
    """Whitened responses (directions, rows) to as much as may be wrong of what was not named, one standard
    deviation each; none where no more than one cause was: a robot with several things wrong has others wrong
    as well, below what shows, and they bend the numbers of those that are named."""
    none, active = np.zeros((0, search.fit.whitened_residual.size)), search.fit.point.active
    if len(active) < SEVERAL_CAUSES:
        return none
    named = {name.partition("@")[0] for name in active}
    variants = {each.name: each.columns for each in reversed(search.linear.groups)}  # the first of each
    columns = [
        each
        for name, each in variants.items()
        if name.partition("@")[0] not in named and f"{name}@left" not in variants
    ]
    return search.whitener(UNNAMED_CAUSE_WIDTH * np.concatenate(columns)) if columns else none


def _stair_curvature(search: Search) -> Array:
    """Curvature of coordinates on a flat stair, (coordinates,): from how far they can go either way before
    the misfit, the prior with it, rises by 1, as it does at one standard deviation."""
    problem, fit = search.problem, search.fit
    vector = fit.point.vector()
    norms = np.linalg.norm(fit.jacobian, axis=1)
    curvature = np.zeros(len(vector))
    for index in np.flatnonzero((problem.steps(fit.point) >= MIN_STAIR_STEP) & (norms < MAX_FLAT_NORM)):
        stds = []
        for sign in (-1.0, 1.0):
            moved = np.repeat(vector[None], len(TRIED_WIDTHS), axis=0)
            moved[:, index] += sign * np.array(TRIED_WIDTHS)
            moved = np.clip(moved, *problem.limits(fit.point))
            points = [fit.point.moved(each) for each in moved]
            rise = costs_at(problem, search.whitener, points) - fit.cost
            stds.append(
                next(
                    (away for away, each in zip(TRIED_WIDTHS, rise, strict=True) if each > 1.0),
                    TRIED_WIDTHS[-1],
                )
            )
        curvature[index] = max(1.0 / float(np.mean(stds)) ** 2 - norms[index] ** 2 - 1.0, 0.0)
    return curvature


def setting_value(settings: Settings, key: Setting) -> float:
    """A setting; an inertia with what robot.toml leaves open of it, which is counted apart."""
    value = float(settings[key])
    if key[0] != "drive.inertia":
        return value
    open_ = settings[("inertia", None, "straight")] * settings[("inertia", None, "turn")]
    return value * math.sqrt(open_)
