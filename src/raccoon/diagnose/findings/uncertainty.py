"""Uncertainty of the numbers of a fit."""

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
"""Difference step of a coordinate, in its units, for derivatives of the settings."""
MIN_STAIR_STEP = 0.05
"""Difference step of a coordinate from which its misfit is a staircase: a gap that is crossed between two
samples of the gyro may be slightly wider without changing any reading."""
MAX_FLAT_NORM = 3.0
"""Norm of such a coordinate's column below which the difference step at the fit is uninformative."""
NOISE_LEARNING_S = 10.0
"""Length of a drive in s at which the variance of the numbers is increased by a factor of two. On shorter
drives numbers scatter by more than the noise predicts, since noise that is estimated from few moments is too
small."""
UNNAMED_CAUSE_WIDTH = 0.05
"""Standard deviation, in prior widths, of each cause that is not named, if several are named."""
TRIED_WIDTHS = (0.01, 0.02, 0.035, 0.06, 0.1, 0.18, 0.3, 0.55, 1.0)
"""Distances from the fit, in widths, at which such a coordinate is tried: one standard deviation is where the
cost has risen by 1."""


@dataclass(frozen=True, slots=True)
class FitUncertainty:
    """Settings at a fit and one difference step along each coordinate from it, and the covariance of the
    coordinates.

    row_s: length in s of a row if encoders are read, else 0. The age of their readings, and of the gyro's, is
    not known better than to a row, and neither is the latency of commands.
    """

    settings: Settings
    moved_settings: tuple[Settings, ...]
    covariance: Array
    row_s: float = 0.0

    @classmethod
    def of(cls, search: Search) -> FitUncertainty:
        """The uncertainty of the fit at the end of a search."""
        problem = search.problem
        point = without_floor_friction(problem, search.fit.point, search.whitener.wander_share)
        vector = point.vector()
        steps = COORDINATE_STEP * np.eye(len(vector))
        moved = tuple(problem.settings(point.moved(vector + step)) for step in steps)
        row = problem.neutral.get(WINDOW, 0.0)
        return cls(problem.settings(point), moved, coordinate_covariance(search), row)

    def value_of(self, key: Setting) -> float:
        """A setting at the fit; an inertia includes its base numbers."""
        return setting_value(self.settings, key)

    def std(self, key: Setting) -> float:
        """Standard deviation of a setting, by the chain rule through every coordinate; 0 if it was not
        fitted."""
        value = self.value_of(key)
        slope = np.array(
            [(setting_value(other, key) - value) / COORDINATE_STEP for other in self.moved_settings]
        )
        slope = np.where(np.isfinite(slope), slope, 0.0)
        std = math.sqrt(max(float(slope @ self.covariance @ slope), 0.0))
        return math.hypot(std, self.row_s / math.sqrt(12.0)) if std > 0.0 and key[0] == LATENCY else std


def coordinate_covariance(search: Search) -> Array:
    """Covariance of all coordinates: that of the curvature, increased if blocks of time disagree more than it
    predicts.

    Sandwich estimate H^-1 (sum_b g_b g_b') H^-1 of White (1982) over blocks. With few blocks it is noisy, so
    only its mean ratio to the curvature's variance is used, and only if that is above 1. It is computed for
    the free coordinates alone: if one that is fixed at a bound acts like a free one, blocks would seem to
    disagree several hundred times as much as they do. The covariance is also increased for short recordings,
    and by the causes that are not named if several are.
    """
    fit = search.fit
    columns = fit.jacobian
    known = _stair_curvature(search) + _reading_curvature(search)
    hessian = columns @ columns.T + np.eye(len(columns)) + np.diag(known)
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
    """Whitened responses (directions, rows) to a deviation of one standard deviation of each cause that was
    not named; empty if at most one was named. A robot with several faults has further ones that are too small
    to show, and they change the numbers of the named ones."""
    none, active = np.zeros((0, search.fit.whitened_residual.size)), search.fit.point.active
    if len(active) < SEVERAL_CAUSES:
        return none
    named = {name.partition("@")[0] for name in active}
    variants = {each.name: each.columns for each in reversed(search.linear.groups)}  # first variants
    columns = [
        each
        for name, each in variants.items()
        if name.partition("@")[0] not in named and f"{name}@left" not in variants
    ]
    return search.whitener(UNNAMED_CAUSE_WIDTH * np.concatenate(columns)) if columns else none


def _stair_curvature(search: Search) -> Array:
    """Curvature of coordinates on a flat stair, (coordinates,): from the distance to either side at which the
    misfit, with the prior, rises by 1, as it does at one standard deviation."""
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


def _reading_curvature(search: Search) -> Array:
    """Curvature of coordinates whose size the readings themselves show, (coordinates,). The misfit does not
    show that of a dead zone: it is flat from the fastest speed that was read as 0 to the smallest reading."""
    curvature = np.zeros(len(search.fit.point.vector()))
    for name, span in search.fit.point.spans().items():
        if name in search.problem.reading_evidence:
            curvature[span.start] = search.problem.reading_evidence[name].std ** -2
    return curvature


def setting_value(settings: Settings, key: Setting) -> float:
    """A setting; an inertia includes its base numbers, which are separate settings."""
    value = float(settings[key])
    if key[0] != "drive.inertia":
        return value
    open_ = settings[("inertia", None, "straight")] * settings[("inertia", None, "turn")]
    return value * math.sqrt(open_)
