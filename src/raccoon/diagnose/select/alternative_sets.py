"""Alternative sets of causes, which may explain a recording better than the set of the stepwise search.

Adding one cause at a time can go astray: two wrong causes can imitate a right one, and neither can be dropped
alone. So if several causes are named, all causes with a nearly linear response are fitted at once. That model
is near the truth wherever the truth is, and from there `set_scoring` proposes sets. In addition each cause is
exchanged for those with the most similar responses, and the set for its twins. The proposals are refitted
with the full simulation and compared by `log_evidence_lead`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point, fit_starts, fit_with_frozen_columns
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.refits import CONFOUNDED_FAMILIES, both_signs, first_guess
from raccoon.diagnose.select.rivals import MIN_NET_LEAD, find_similar_causes, net_lead
from raccoon.diagnose.select.set_scoring import Member, MemberSet, SetScorer, overlaps_none
from raccoon.diagnose.select.state import Search, linearise_search
from raccoon.diagnose.select.twins import fit_twins

MAX_PROPOSALS = 3
"""Number of sets that each linear model proposes."""
MAX_REFINED = 3
"""Number of proposals that are fitted with new columns."""
MAX_SAME_DISTANCE = 1.0
"""Bound on the sum of squared differences of two whitened residuals for which the fits count as the same
prediction."""
MAX_DEFICIT_TO_REFINE = 60.0
"""Log evidence by which a proposal may be behind to be fitted with new columns."""
MIN_EXCHANGE_COSINE = 0.3
"""Threshold on the cosine of two causes' responses, above which one is tried in the place of the other."""
MAX_EXCHANGES = 5
"""Maximum number of causes that are tried in the place of each cause."""
ONE_SIDED_START = 0.002
"""Widths at which a one-sided cause starts in a fit of all causes: off its bound, but too small to matter.
With ten times as much, latencies that the robot did not have raised the misfit by 240, and no step led
back."""
LONE_START = 0.4
"""Widths at which a cause starts in a fit without other causes."""
NEARLY_LINEAR_CAUSES = (
    "motor.armature_resistance@left", "motor.armature_resistance@right", "motor.back_emf_constant@left",
    "motor.back_emf_constant@right", "bemf.scale@left", "bemf.scale@right", "drive.wheel_radius@left",
    "drive.wheel_radius@right", "drive.inertia", "friction.coulomb", "friction.viscous", "friction.quadratic",
    "friction.load_dependent", "drive.turn_scrub", "battery.open_circuit_voltage",
    "battery.internal_resistance", "bemf.offset@left", "bemf.offset@right", "bemf.filter_lag",
    "imu.gyro_bias", "imu.gyro_scale", "imu.latency", "actuation.latency",
)  # fmt: skip
"""Causes with a nearly linear response, one of each group of twins."""


def find_better_set(search: Search) -> Fit | None:
    """The fit of another set of causes that explains more; None if there is none."""
    problem, whitener = search.problem, search.whitener
    others = _exchange_starts(search) if search.fit.point.active else _single_cause_starts(search)
    starts = [*_propose_from_linear_fit(search), *_propose_from_working_point(search), *others]
    current = fit_point(problem, whitener, search.fit, 2)
    base = search.fit.jacobian[: len(problem.base)]
    fits = fit_with_frozen_columns(problem, whitener, starts, base, 4)
    fits += [fit for _, fit in fit_twins(search)]
    fits.sort(key=lambda fit: -net_lead(search, fit, current))
    best = _select_distinct(fits, MAX_REFINED)
    best += _best_relatives(fits, best)
    promising = [each.point for each in best if net_lead(search, each, current) > -MAX_DEFICIT_TO_REFINE]
    refined = [_drop_unneeded(search, fit) for fit in fit_starts(problem, whitener, promising, 4)]
    first = max(refined, key=lambda fit: net_lead(search, fit, current), default=None)
    return first if first is not None and net_lead(search, first, current) > MIN_NET_LEAD else None


def _select_distinct(fits: Sequence[Fit], max_count: int) -> list[Fit]:
    """The first `max_count` fits with different predictions: otherwise twins would take every place."""
    found: list[Fit] = []
    for fit in fits:
        if all(
            float(((fit.whitened_residual - each.whitened_residual) ** 2).sum()) > MAX_SAME_DISTANCE
            for each in found
        ):
            found.append(fit)
        if len(found) == max_count:
            break
    return found


def _best_relatives(fits: Sequence[Fit], best: Sequence[Fit]) -> list[Fit]:
    """The best fit of each relative (see `CONFOUNDED_FAMILIES`) of a cause that is alone in one of the best
    sets: where base numbers are far off, the columns favour the wrong relative."""
    alone = [next(iter(each.point.active)) for each in best if len(each.point.active) == 1]
    wholes = {name.partition("@")[0] for name in alone}
    relatives = {each for family in CONFOUNDED_FAMILIES if wholes & set(family) for each in family} - set(
        alone
    )
    found = (
        next((fit for fit in fits if list(fit.point.active) == [each]), None) for each in sorted(relatives)
    )
    return [each for each in found if each is not None]


def lead_over_search(search: Search, other: Search) -> float:
    """Lead of one search's fit over another's, each less its gates, under the noise of the other one. Their
    simulators may differ."""
    fit = evaluate_fit(search.problem, other.whitener, search.fit.point)
    return net_lead(other, fit, other.fit)


def _propose_from_linear_fit(search: Search) -> Iterator[Point]:
    """Starting points of the best sets according to the linear model around a fit of all nearly linear
    causes."""
    problem, active = search.problem, frozenset(search.fit.point.active)
    fit = fit_point(problem, search.whitener, _with_all_nearly_linear(search), 6)
    around = linearise_search(problem, search.probes, fit.point, search.whitener, search.unknown)
    sets = SetScorer.of(around)
    fitted = range(len(fit.point.active))
    acting = (
        i for i in fitted if not sets.members[i].one_sided or fit.point.active[sets.members[i].name][0] > 0.0
    )
    sets.climb(sets.without_unneeded(frozenset(acting)))
    sets.climb(frozenset(i for i in fitted if sets.members[i].name in active))
    sets.climb(frozenset())
    yield from _starts_of_best_sets(around, sets, active)


def _propose_from_working_point(search: Search) -> Iterator[Point]:
    """Starting points of the best sets according to the linear model at the working point: a cause that
    imitates two others was added with the columns of a point without it."""
    sets, active = SetScorer.of(search), frozenset(range(len(search.fit.point.active)))
    sets.climb(active)
    yield from _starts_of_best_sets(search, sets, sets.names(active))


def _starts_of_best_sets(search: Search, sets: SetScorer, active: frozenset[str]) -> Iterator[Point]:
    """Starting points of the best sets other than `active`, and of each of them without its new causes that
    have a kinked response: a predicted dead zone made a set 80 worse that was 28 ahead without it."""
    found = {active}
    for best in sets.best_sets(MAX_PROPOSALS):
        unkinked = frozenset(
            i for i in best if sets.names(frozenset({i})) <= active or not _is_kinked(sets.members[i])
        )
        for chosen in (best, unkinked):
            if sets.names(chosen) not in found:
                found.add(sets.names(chosen))
                yield _start_of_set(search, sets, chosen)


def _is_kinked(member: Member) -> bool:
    """Whether a member's response has a kink at size 0."""
    return member.one_sided and member.name not in NEARLY_LINEAR_CAUSES


def _with_all_nearly_linear(search: Search) -> Point:
    """The working point with every nearly linear cause active; causes of both sides are split into one per
    side."""
    point, causes = search.fit.point, search.problem.causes
    for name in [each for each in point.active if f"{each}@left" in NEARLY_LINEAR_CAUSES]:
        u = point.active[name]
        point = point.without_cause(name).with_cause(f"{name}@left", u).with_cause(f"{name}@right", u)
    for name in NEARLY_LINEAR_CAUSES:
        if name in causes and overlaps_none(name, point.active):
            point = point.with_cause(name, np.array([ONE_SIDED_START if causes[name].one_sided else 0.0]))
    return point


def _start_of_set(search: Search, sets: SetScorer, chosen: MemberSet) -> Point:
    """The point at which the linear model expects a set of causes. Base coordinates keep their values, since
    the first step of a fit moves them."""
    mean, _ = sets.solve(chosen)
    point, position = Point(search.fit.point.base), 0
    for each in sorted(chosen):
        member = sets.members[each]
        u = mean[position : position + len(member.span)]
        position += len(member.span)
        if member.group is not None:
            u = first_guess(search, member.group, u)
        elif member.one_sided:
            u = np.array([max(u[0], ONE_SIDED_START), *u[1:]])
        point = point.with_cause(member.name, u)
    return point


def _single_cause_starts(search: Search) -> Iterator[Point]:
    """Starting points of each nearly linear cause alone, on one side or both, with either sign."""
    for name in sorted(
        {*NEARLY_LINEAR_CAUSES, *(each.partition("@")[0] for each in NEARLY_LINEAR_CAUSES)}
        & set(search.problem.causes)
    ):
        for u in both_signs(search.problem, name, (LONE_START,)):
            yield search.fit.point.with_cause(name, np.array(u))


def _exchange_starts(search: Search) -> Iterator[Point]:
    """Starting points with each cause replaced by those with the most similar responses."""
    for name in search.fit.point.active:
        yield from find_similar_causes(search, name, MIN_EXCHANGE_COSINE, MAX_EXCHANGES).values()


def _drop_unneeded(search: Search, fit: Fit) -> Fit:
    """The fit after causes were dropped, one by one, that do not reach their gates beside the others."""
    while len(fit.point.active) > 1:
        leads = _linear_leads(fit)
        weakest = min(leads, key=lambda name: leads[name] - gate(name))
        if leads[weakest] > gate(weakest):
            return fit
        fit = fit_point(search.problem, search.whitener, fit.point.without_cause(weakest), 3)
    return fit


def _linear_leads(fit: Fit) -> dict[str, float]:
    """Log evidence that each cause adds to all others, according to the linear model of the fit."""
    columns = fit.jacobian[fit.free]
    whole = Gram.of(columns.T, fit.target)
    evidence, place = whole.evidence(), np.cumsum(fit.free) - 1
    leads = {}
    for name, span in fit.point.spans().items():
        own = {int(place[i]) for i in span if fit.free[i]}
        leads[name] = evidence - whole.take([i for i in range(len(columns)) if i not in own]).evidence()
    return leads
