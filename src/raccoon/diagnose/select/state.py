"""State of the search at a working point (fit, noise, columns of every direction), and leads between fits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.backlash_scan import fit_with_backlash_scan
from raccoon.diagnose.fit.evidence import Gram, held_out_residual, split_rows
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point
from raccoon.diagnose.fit.linear_model import ColumnGroup, GramTable, LinearModel, gram_tables, linearise
from raccoon.diagnose.fit.noise_estimation import estimate_whitener
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.hypotheses.coordinates import Settings

Array = NDArray[np.float64]

HELD_OUT_BLOCKS = 8
"""Of time, of which each is foreseen by a fit of all others."""
FINAL_WANDER_SHARE = 0.15
"""Part of the size of wandering friction that a last fit may use."""
MAX_EVENT_LEAD = 4.0
"""Log evidence that half a second may give."""


@dataclass(frozen=True, slots=True)
class Rival:
    """Another cause that was tried in the place of one that was taken. lead: log evidence it lacks.

    beside: not in its place, but with a part of it. together: what else is then on that is off now.
    settings: the robot that was fitted so, where it was.
    """

    name: str
    lead: float
    beside: bool = False
    together: tuple[str, ...] = ()
    settings: Settings | None = field(default=None, compare=False)


@dataclass(slots=True)
class Search:
    """State of the search, and what it found in the end.

    leads: log evidence that each cause adds to all others. held_out_leads: the same on held-out blocks.
    rivals: causes that explain nearly as much in its place. rejections: why a cause is not named.
    table, table_without_wander: Gram numbers of all columns under the whole noise, and without what wanders.
    unknown: probes that explain what no cause does, with the evidence they add.
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
        """All that stands so far: the causes that are on, and what is unknown."""
        return (*self.fit.point.active, *self.unknown)

    @property
    def listed(self) -> str:
        """The same, to be said."""
        return ", ".join(self.named) or "none"


def block_grams(fit: Fit) -> list[Gram]:
    """Gram numbers of a fit by blocks of time."""
    target, columns = fit.target, fit.jacobian[fit.free]
    return [Gram.of(columns[:, part].T, target[part]) for part in split_rows(len(target), HELD_OUT_BLOCKS)]


@dataclass(frozen=True, slots=True)
class HeldOutPrediction:
    """How a fit does on held-out data. residual (rows,): whitened residual of each block of time, predicted
    by a fit of all others. prior_cost: half the squared base coordinates, since what robot.toml says is data
    as well."""

    residual: Array
    prior_cost: float

    @classmethod
    def of(cls, fit: Fit) -> HeldOutPrediction:
        """Of a fit."""
        base = fit.point.base
        return cls(
            held_out_residual(fit.jacobian[fit.free], fit.target, HELD_OUT_BLOCKS), 0.5 * float(base @ base)
        )


def held_out_lead(problem: Problem, one: HeldOutPrediction, other: HeldOutPrediction) -> float:
    """Log predictive score of one fit over another; each half second is clipped as in `log_evidence_lead`."""
    return (
        other.prior_cost
        - one.prior_cost
        + float(_clip_events(_lead_by_event(problem, one.residual, other.residual)).sum())
    )


def start_search(problem: Problem, probes: Callable[[LinearModel], Sequence[ColumnGroup]]) -> Search:
    """Fit what robot.toml leaves open, and look in every direction from there.

    For the noise of that first fit one size of each cause will do, and of those on both wheels the two apart:
    on drives with an effect of a tenth or a third of its size the evidence of it was then as large as with
    all. Without any of them it was down to a half, and nothing was left of a motor that cogs a little.
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
    """Columns in every direction at a point, the noise that they leave, and the fit under it."""
    linear = linearise(problem, point, list(problem.causes))
    extra = probes(linear)
    whitener = estimate_whitener(problem, linear, extra, before, tuple(unknown or ()))
    table, plain = gram_tables(linear, extra, whitener)
    fit = _fit_of(problem, linear, whitener)
    return Search(problem, probes, fit, whitener, linear, table, plain, unknown=dict(unknown or {}))


def _fit_of(problem: Problem, linear: LinearModel, whitener: Whitener) -> Fit:
    """The fit that a point is with its columns."""
    white = whitener(np.concatenate([linear.residual[None], linear.jacobian]))
    return Fit.of(problem, linear.point, white[0], white[1:])


def refit_with_final_noise(search: Search) -> Search:
    """The same causes fitted once more, now that the search is over: nothing that an effect does counts as
    noise."""
    problem, extra = search.problem, search.probes(search.linear)
    unknown = tuple(search.unknown)
    whitener = estimate_whitener(problem, search.linear, extra, search.whitener, unknown, tolerant=False)
    search = replace(search, whitener=whitener)
    steady = final_fit_whitener(search)
    point = fit_with_backlash_scan(problem, steady, _fit_of(problem, search.linear, steady), last=True).point
    fit = evaluate_fit(problem, whitener, point)
    residual = problem.features.measured - problem.predict([fit.point])[0]
    linear = replace(search.linear, point=fit.point, residual=residual)
    return replace(search, fit=fit, linear=linear)


def final_fit_whitener(search: Search) -> Whitener:
    """The noise of a last fit, which friction that wanders may explain only in part.

    Wandering friction of its whole size also takes the constant part of a friction that is off. What is left
    to decide the friction then are stops, whose form no model has quite right.
    """
    return search.whitener if search.unknown else search.whitener.with_wander_share(FINAL_WANDER_SHARE)


Screening = list[tuple[float, ColumnGroup, Array]]


def screen_groups(search: Search, table: GramTable | None = None, hold_bounds: bool = False) -> Screening:
    """Evidence that each cause that is off would add, by the linear model; best first.

    held: what a bound holds stays there; else it goes where it is best beside each.
    """
    table = search.table if table is None else table
    limits, spans = search.problem.limits(search.fit.point), [span for _, span in table.inactive]
    stays = hold_bounds or bool(search.fit.free.all())
    solved = _solve_beside_held(search, table) if stays else table.gram.solve_beside_bounded(*limits, spans)
    found = [
        (gain, group, mean)
        for (group, _), (mean, gain) in zip(table.inactive, solved, strict=True)
        if not group.one_sided or mean[0] > 0.0
    ]
    found.sort(key=lambda each: -each[0])
    return found


def _solve_beside_held(search: Search, table: GramTable) -> Iterator[tuple[Array, float]]:
    """Coordinates of each group that is off, and the log evidence that it adds to all that is on."""
    free = search.fit.free
    always = [int(i) for i in np.flatnonzero(free)]
    stay = np.zeros(len(table.gram.projection))
    stay[: len(free)] = np.where(free, 0.0, search.fit.point.vector())
    whole = table.gram.shifted(stay)
    rest = whole.take([*always, *(i for _, span in table.inactive for i in span)]).eliminate_leading(
        len(always)
    )
    position = 0
    for _, span in table.inactive:
        mean, gain, _ = rest.take(range(position, position + len(span))).solve()
        position += len(span)
        yield mean, gain


def log_evidence_lead(problem: Problem, fit: Fit, other: Fit) -> float:
    """Log evidence of `fit` over `other`, of which no half second may count for more than a little.

    A wheel that breaks loose a moment too late is a large error of one moment, and any parameter that shifts
    that moment would seem to explain much. What a cause really does, it does again and again.
    """
    told = problem.reading_evidence_at(fit.point) - problem.reading_evidence_at(other.point)
    return (
        told
        + fit.evidence
        - other.evidence
        - event_excess(problem, fit.whitened_residual, other.whitened_residual)
    )


def nested_lead(problem: Problem, fit: Fit, less: Fit) -> float:
    """`log_evidence_lead` of a fit over one without some of its causes, with all the others equally certain.

    How sure they are is in their columns at either point. Beside wheels with play, whose response is a
    staircase, it differs from stair to stair by several of log evidence, which are no merit of a cause.
    """
    ahead = log_evidence_lead(problem, fit, less)
    if not (fit.is_finite and less.is_finite):
        return ahead
    spans = fit.point.spans()
    gone = [row for name in spans if name not in less.point.active for row in spans[name]]
    kept = np.delete(np.arange(len(fit.jacobian)), gone)
    _, here = np.linalg.slogdet(fit.curvature[np.ix_(kept, kept)])
    _, there = np.linalg.slogdet(less.curvature)
    return ahead + 0.5 * float(here - there)


def event_excess(problem: Problem, white: Array, other: Array) -> float:
    """Log evidence of one whitened residual over another beyond what single events may give."""
    events = _lead_by_event(problem, white, other)
    return float((events - _clip_events(events)).sum())


def _lead_by_event(problem: Problem, white: Array, other: Array) -> Array:
    """Log likelihood of one whitened residual over another by half seconds."""
    gains, features = 0.5 * (other**2 - white**2), problem.features
    return np.add.reduceat(gains, np.arange(0, len(gains), features.event * features.measured.shape[1]))


def _clip_events(events: Array) -> Array:
    """None beyond what a half second may give."""
    return np.clip(events, -MAX_EVENT_LEAD, MAX_EVENT_LEAD)
