"""State of the search: a working point, its fit, its noise, and the columns of all directions there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.backlash_scan import fit_with_backlash_scan
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point
from raccoon.diagnose.fit.linear_model import ColumnGroup, GramTable, LinearModel, gram_tables, linearise
from raccoon.diagnose.fit.noise_estimation import estimate_whitener
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.hypotheses.coordinates import Settings

Array = NDArray[np.float64]

FINAL_WANDER_SHARE = 0.15
"""Factor on the size of slowly varying friction in the last fit."""


@dataclass(frozen=True, slots=True)
class Rival:
    """Another cause that was tried in the place of an active one. lead: log evidence by which it is behind
    that cause.

    beside: whether it was tried beside the cause, with a share of its size, and not in its place. together:
    further causes that are active with it and are not active now. settings: of the robot fitted with it, or
    None. point: where it was fitted in the cause's place, or None.
    """

    name: str
    lead: float
    beside: bool = False
    together: tuple[str, ...] = ()
    settings: Settings | None = field(default=None, compare=False)
    point: Point | None = field(default=None, compare=False)


@dataclass(slots=True)
class Search:
    """State of the search, and its results.

    leads: log evidence that each cause adds to all others. held_out_leads: the same on held-out blocks.
    rivals: what was tried in the place of each cause. rejections: why a cause is not named. probes: function
    that makes the probes of a linear model. table, table_without_wander: Gram tables of all columns under the
    whole noise, and under the noise without slowly varying friction. unknown: probes of effects outside the
    catalogue, with the evidence that they add.
    """

    problem: Problem
    probes: Callable[[LinearModel], Sequence[ColumnGroup]]
    fit: Fit
    whitener: Whitener
    linear: LinearModel
    table: GramTable
    table_without_wander: GramTable
    leads: dict[str, float] = field(default_factory=dict)
    held_out_leads: dict[str, float] = field(default_factory=dict)
    rivals: dict[str, list[Rival]] = field(default_factory=dict)
    rejections: dict[str, str] = field(default_factory=dict)
    unknown: dict[str, float] = field(default_factory=dict)

    @property
    def named(self) -> tuple[str, ...]:
        """Names of the active causes and of the unknown probes."""
        return (*self.fit.point.active, *self.unknown)

    @property
    def listed(self) -> str:
        """The same names as text."""
        return ", ".join(self.named) or "none"


def start_search(problem: Problem, probes: Callable[[LinearModel], Sequence[ColumnGroup]]) -> Search:
    """Fit the base numbers and linearise in all directions there.

    The noise of this first fit uses one size of each cause, and of causes of both wheels only those of each
    wheel: in drives with an effect of a tenth or a third of its size, the evidence of the effect was then as
    large as with all columns. Without any of them it was as low as half, and that of a motor that cogs
    slightly vanished.
    """
    causes = [each for each in problem.causes if f"{each}@left" not in problem.causes]
    linear = linearise(problem, problem.nominal(), causes, sizes=1)
    whitener = estimate_whitener(problem, linear, probes(linear), None)
    fit = fit_point(problem, whitener, _fit_of(problem, linear, whitener))
    return linearise_search(problem, probes, fit.point, whitener)


def linearise_search(
    problem: Problem,
    probes: Callable[[LinearModel], Sequence[ColumnGroup]],
    point: Point,
    before: Whitener,
    unknown: Mapping[str, float] | None = None,
) -> Search:
    """Compute the columns of all directions at a point, the noise given these, and the fit under that noise.

    before: the previous whitener. unknown: probes that are part of the noise, with the evidence that they
    add.
    """
    linear = linearise(problem, point, list(problem.causes))
    extra = probes(linear)
    whitener = estimate_whitener(problem, linear, extra, before, tuple(unknown or ()))
    table, plain = gram_tables(linear, extra, whitener)
    fit = _fit_of(problem, linear, whitener)
    return Search(problem, probes, fit, whitener, linear, table, plain, unknown=dict(unknown or {}))


def _fit_of(problem: Problem, linear: LinearModel, whitener: Whitener) -> Fit:
    """The fit at the linear model's point, with residual and columns whitened."""
    white = whitener(np.concatenate([linear.residual[None], linear.jacobian]))
    return Fit.of(problem, linear.point, white[0], white[1:])


def refit_with_final_noise(search: Search) -> Search:
    """Fit the same causes once more when the search is over, under noise without deviations of the
    effects."""
    problem, extra = search.problem, search.probes(search.linear)
    unknown = tuple(search.unknown)
    whitener = estimate_whitener(problem, search.linear, extra, search.whitener, unknown, tolerant=False)
    search = replace(search, whitener=whitener)
    reduced = final_fit_whitener(search)
    start = _fit_of(problem, search.linear, reduced)
    point = fit_with_backlash_scan(problem, reduced, start, last=True).point
    fit = evaluate_fit(problem, whitener, point)
    residual = problem.features.measured - problem.predict([fit.point])[0]
    linear = replace(search.linear, point=fit.point, residual=residual)
    return replace(search, fit=fit, linear=linear)


def final_fit_whitener(search: Search) -> Whitener:
    """The whitener of the last fit, with slowly varying friction reduced.

    At its whole size slowly varying friction also absorbs the constant part of a wrong friction. Only stops,
    whose form no model has exactly, would be left to determine that.
    """
    return search.whitener if search.unknown else search.whitener.with_wander_share(FINAL_WANDER_SHARE)
