"""Whether another set of causes explains a recording better than the one that was found step by step.

Adding one cause at a time can go astray: two wrong ones can stand in for a right one, and neither is worth
dropping alone. So once several are named, everything whose response is nearly a straight line is fitted at
once. That model is near the truth wherever the truth is, and from there `set_scoring` proposes sets.
Each cause is also exchanged for those that act most like it, and the set for those that are the same drive
in other numbers. The proposals are truly fitted, and compared moment by moment.
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
"""Sets that each look at the linear model proposes."""
MAX_REFINED = 3
"""Of all proposals, those that are fitted with every column simulated anew."""
MAX_SAME_DISTANCE = 1.0
"""Sum of squares, in units of the noise, up to which two fits say the same."""
MAX_DEFICIT_TO_REFINE = 60.0
"""Log evidence that a proposal may lack before that."""
MIN_EXCHANGE_COSINE = 0.3
"""Cosine from which another cause is tried in the place of one."""
MAX_EXCHANGES = 5
"""Such causes."""
ONE_SIDED_START = 0.002
"""Where a one-sided cause starts in a fit of everything: off its bound, and yet too little to do anything. At
ten times that, latencies that are not there had raised the misfit by 240, and no step led back."""
LONE_START = 0.4
"""Widths at which one begins by itself."""
NEARLY_LINEAR_CAUSES = (
    "motor.armature_resistance@left", "motor.armature_resistance@right", "motor.back_emf_constant@left",
    "motor.back_emf_constant@right", "bemf.scale@left", "bemf.scale@right", "drive.wheel_radius@left",
    "drive.wheel_radius@right", "drive.inertia", "friction.coulomb", "friction.viscous", "friction.quadratic",
    "friction.load_dependent", "drive.turn_scrub", "battery.open_circuit_voltage",
    "battery.internal_resistance", "bemf.offset@left", "bemf.offset@right", "bemf.filter_lag",
    "imu.gyro_bias", "imu.gyro_scale", "imu.latency", "actuation.latency",
)  # fmt: skip
"""Causes whose response is nearly a straight line, one of each group of twins."""


def find_better_set(search: Search) -> Fit | None:
    """Another set of causes that explains more, fitted; None where there is none."""
    problem, whitener = search.problem, search.whitener
    others = _exchange_starts(search) if search.fit.point.active else _single_cause_starts(search)
    starts = [*_propose_from_linear_fit(search), *_propose_from_working_point(search), *others]
    settled = fit_point(problem, whitener, search.fit, 2)
    base = search.fit.jacobian[: len(problem.base)]
    fits = fit_with_frozen_columns(problem, whitener, starts, base, 4)
    fits += [fit for _, fit in fit_twins(search)]
    fits.sort(key=lambda fit: -net_lead(search, fit, settled))
    best = _select_distinct(fits, MAX_REFINED)
    best += _best_relatives(fits, best)
    hopeful = [each.point for each in best if net_lead(search, each, settled) > -MAX_DEFICIT_TO_REFINE]
    polished = [_drop_unneeded(search, fit) for fit in fit_starts(problem, whitener, hopeful, 4)]
    first = max(polished, key=lambda fit: net_lead(search, fit, settled), default=None)
    return first if first is not None and net_lead(search, first, settled) > MIN_NET_LEAD else None


def _select_distinct(fits: Sequence[Fit], most: int) -> list[Fit]:
    """The first fits that do not predict what one before them does: twins would take every place."""
    found: list[Fit] = []
    for fit in fits:
        if all(
            float(((fit.whitened_residual - each.whitened_residual) ** 2).sum()) > MAX_SAME_DISTANCE
            for each in found
        ):
            found.append(fit)
        if len(found) == most:
            break
    return found


def _best_relatives(fits: Sequence[Fit], best: Sequence[Fit]) -> list[Fit]:
    """The best fit of each relative of a cause that stands alone among the best: columns of a bent model lead
    to the wrong one of them."""
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
    """Log evidence of what one search found over what another did, each less its gates, under the other's
    noise. Their simulators may differ."""
    fit = evaluate_fit(search.problem, other.whitener, search.fit.point)
    return net_lead(other, fit, other.fit)


def _propose_from_linear_fit(search: Search) -> Iterator[Point]:
    """The best sets as the linear model around a fit of everything straight sees them."""
    problem, now = search.problem, frozenset(search.fit.point.active)
    fit = fit_point(problem, search.whitener, _with_all_nearly_linear(search), 6)
    around = linearise_search(problem, search.probes, fit.point, search.whitener, search.unknown)
    sets = SetScorer.of(around)
    on = range(len(fit.point.active))
    acting = (
        i for i in on if not sets.members[i].one_sided or fit.point.active[sets.members[i].name][0] > 0.0
    )
    sets.climb(sets.without_unneeded(frozenset(acting)))
    sets.climb(frozenset(i for i in on if sets.members[i].name in now))
    sets.climb(frozenset())
    yield from _starts_of_best_sets(around, sets, now)


def _propose_from_working_point(search: Search) -> Iterator[Point]:
    """The best sets as the linear model at the working point sees them: where one cause stands for two
    others, it was taken when the columns were those of a point without it."""
    sets, now = SetScorer.of(search), frozenset(range(len(search.fit.point.active)))
    sets.climb(now)
    yield from _starts_of_best_sets(search, sets, sets.names(now))


def _starts_of_best_sets(search: Search, sets: SetScorer, now: frozenset[str]) -> Iterator[Point]:
    """Where to start the best sets that are not `now`, and each without what would be new in it and is
    kinked: a dead zone that a straight line foresaw made a set 80 worse that was 28 ahead without it."""
    found = {now}
    for best in sets.best_sets(MAX_PROPOSALS):
        straight = frozenset(
            i for i in best if sets.names(frozenset({i})) <= now or not _is_kinked(sets.members[i])
        )
        for chosen in (best, straight):
            if sets.names(chosen) not in found:
                found.add(sets.names(chosen))
                yield _start_of_set(search, sets, chosen)


def _is_kinked(member: Member) -> bool:
    return member.one_sided and member.name not in NEARLY_LINEAR_CAUSES


def _with_all_nearly_linear(search: Search) -> Point:
    """The working point with every straight cause on; one of both sides is taken apart."""
    point, causes = search.fit.point, search.problem.causes
    for name in [each for each in point.active if f"{each}@left" in NEARLY_LINEAR_CAUSES]:
        u = point.active[name]
        point = point.without_cause(name).with_cause(f"{name}@left", u).with_cause(f"{name}@right", u)
    for name in NEARLY_LINEAR_CAUSES:
        if name in causes and overlaps_none(name, point.active):
            point = point.with_cause(name, np.array([ONE_SIDED_START if causes[name].one_sided else 0.0]))
    return point


def _start_of_set(search: Search, sets: SetScorer, chosen: MemberSet) -> Point:
    """Where the linear model puts a set; base numbers stay, since a fit moves them at once."""
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
    """Each straight cause on its own, on one side or both, from either sign."""
    for name in sorted(
        {*NEARLY_LINEAR_CAUSES, *(each.partition("@")[0] for each in NEARLY_LINEAR_CAUSES)}
        & set(search.problem.causes)
    ):
        for u in both_signs(search.problem, name, (LONE_START,)):
            yield search.fit.point.with_cause(name, np.array(u))


def _exchange_starts(search: Search) -> Iterator[Point]:
    """Each cause replaced by those that act most like it."""
    for name in search.fit.point.active:
        yield from find_similar_causes(search, name, MIN_EXCHANGE_COSINE, MAX_EXCHANGES).values()


def _drop_unneeded(search: Search, fit: Fit) -> Fit:
    """The fit without causes that, beside the others, are no longer worth their gate."""
    while len(fit.point.active) > 1:
        worth = _linear_leads(fit)
        weakest = min(worth, key=lambda name: worth[name] - gate(name))
        if worth[weakest] > gate(weakest):
            return fit
        fit = fit_point(search.problem, search.whitener, fit.point.without_cause(weakest), 3)
    return fit


def _linear_leads(fit: Fit) -> dict[str, float]:
    """Log evidence that each cause adds to all others, by the linear model of the fit."""
    columns = fit.jacobian[fit.free]
    whole = Gram.of(columns.T, fit.target)
    evidence, place = whole.evidence(), np.cumsum(fit.free) - 1
    worth = {}
    for name, span in fit.point.spans().items():
        own = {int(place[i]) for i in span if fit.free[i]}
        worth[name] = evidence - whole.take([i for i in range(len(columns)) if i not in own]).evidence()
    return worth
