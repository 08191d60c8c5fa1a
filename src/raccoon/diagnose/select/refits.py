"""Who is worth a true refit, from where, and how it comes out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.backlash_scan import BACKLASH, find_backlash_starts
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_starts, fit_with_frozen_columns
from raccoon.diagnose.fit.linear_model import ColumnGroup
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.set_scoring import overlaps_none
from raccoon.diagnose.select.state import Screening, Search, log_evidence_lead, screen_groups
from raccoon.diagnose.select.symmetry import causes_of_strained_numbers

Array = NDArray[np.float64]

MAX_REFITS = 5
MAX_REFITS_WITHOUT_WANDER = 3
"""Causes that are truly refitted for their evidence under the whole noise, and without what wanders."""
SHARED_SCALE_CAUSES = ("motor.armature_resistance", "drive.inertia", "friction.coulomb", "friction.viscous")
"""Without a current reading these share one scale, which only robot.toml's standard deviations fix."""
TURN_RATE_CAUSES = ("imu.gyro_scale", "motor.back_emf_constant")
"""Turn rate over back-EMF = gyro scale r / (b K_E); the other twins are the gyro's."""
CONFOUNDED_FAMILIES = (SHARED_SCALE_CAUSES, TURN_RATE_CAUSES)
GYRO_LOW_PASS = "imu.low_pass"
"""A gyro whose chip smooths: a habit of the controller, and no cause."""
LAG_FAMILIES = (("imu.latency", "drive.wheel_slip", GYRO_LOW_PASS), ("actuation.latency", "bemf.filter_lag"))
"""Causes that delay the same readings; the parameter of each is a time."""
RELATIVE_START_WIDTHS = (-0.6, 0.6)
"""Widths at which relatives begin."""
STRAINED_STDS = 1.5
"""Standard deviations of robot.toml by which a base number is bent where something large is missing."""
FAR_STRAINED_STDS = 2.5
"""The same where causes may have gone unseen."""
SEVERAL_CAUSES = 2
"""Causes from which others may have gone unseen beside them."""
MAX_REFINED = 3
"""Refits that are refined at most."""
MIN_LEAD_TO_REFINE = 8.0
"""Log evidence that a refit must add to be refined."""
OVERWHELMING_EVIDENCE = 300.0
"""Log evidence, no event limited, from which one is refined whatever its lead: base numbers are then far off
in all the moments that are not the few in which it acts."""
MAX_REFITS_RELINEARISED, MAX_CAUSES_RELINEARISED = 6, 10
"""Refits, and causes in all, that are looked at once more before a search ends."""
SMALL_SIZES = (0.25, 0.03)
"""Widths from which one that is kinked is tried then: a fit of a deadband of 0.0074 beside six other causes
stopped at half of it and lost 2 of log evidence, where from a quarter it adds 16. Play of 0.003 rad was lost
from a quarter, ten times as much."""
HOPELESS_DEFICIT, PREDICTED_DECREASE_FACTOR = 50.0, 2.0
"""Log evidence that one lacks, also after so many times the decrease of the cost that is foretold for its
next step, when it is given up. A deadband that gained four times what was foretold lacked a hundred still."""
SMALL_SHAPES = (0.0, -0.6, 0.6)
"""Widths from a usual one's that its shape has there: that play was lost, by 250 of log evidence, beside
wheels that coast as far as usual, and adds 76 from where they coast half as far."""
ASTRAY_LOSS = 5.0
"""Log evidence that a refit lost beside what is there without its cause: it went astray, since next to none
of the cause costs less."""
BACKLASH_LINEARISATIONS = 8
"""Of a fit of play from there, whose misfit is a staircase."""
MIN_SHARE_OF_BEST_LEAD = 0.35
"""Part of the best one's, from which a refit may still become the best."""


def delay_same_reading(name: str, other: str) -> bool:
    """Whether two causes delay the same readings, so that what one adds is as well the other's."""
    return any({name, other} <= set(family) for family in LAG_FAMILIES)


def screen_candidates(search: Search) -> Screening:
    """The best variants of the causes worth a true refit.

    Screened twice: under the full noise model, and without wandering friction, which resembles a change of
    friction so closely that only a true refit tells them apart.
    """
    chosen: Screening = []
    for table, most in ((search.table, MAX_REFITS), (search.table_without_wander, MAX_REFITS_WITHOUT_WANDER)):
        seen: dict[str, int] = {}
        for gain, group, mean in screen_groups(search, table):
            if group.name not in search.problem.causes or not overlaps_none(
                group.name, search.fit.point.active
            ):
                continue
            count = seen.get(group.name, 0)
            if gain < 1.0 or count >= 2 or (count == 0 and len(seen) >= most):
                continue
            seen[group.name] = count + 1
            if not any(group is other for _, other, _ in chosen):
                chosen.append((gain, group, mean))
    return chosen


def first_guess(search: Search, group: ColumnGroup, mean: Array) -> Array:
    """Coordinates at which to start a cause's refit: as far as the linear model says, within a width or
    two."""
    cause = search.problem.causes[group.name]
    if not group.start:
        return np.clip(mean, -2.0, 2.0)
    first = float(np.clip(mean[0], 0.2 * group.start[0] if cause.one_sided else -3.0, 4.0))
    if len(cause.variants) > 1 and 0.6 < first / group.start[0] < 1.7:
        first = group.start[0]  # kinked: the guess was simulated, what lies between is only a straight line
    return np.array([first, *group.start[1:]])


def both_signs(problem: Problem, name: str, point: tuple[float, ...]) -> list[tuple[float, ...]]:
    """A cause's coordinates, and the same the other way where it has one."""
    if problem.causes[name].one_sided:
        return [point]
    return [point, (-point[0], *point[1:])]


def refit_candidates(search: Search) -> list[tuple[str, Fit]]:
    """True refits of the most promising causes, best evidence first, one a cause."""
    chosen = [(group.name, first_guess(search, group, mean)) for _, group, mean in screen_candidates(search)]
    chosen.extend(_relative_starts(search, [name for name, _ in chosen]))
    named = [(name, search.fit.point.with_cause(name, u)) for name, u in chosen]
    named.extend(split_lags(search))
    if search.fit.point.active:  # before, everything is bent by the cause that is looked for
        named.extend(causes_of_strained_numbers(search.problem, search.fit.point, FAR_STRAINED_STDS))
    starts = [start for _, start in named]
    fits = fit_with_frozen_columns(search.problem, search.whitener, starts, search.fit.jacobian, 4)
    play = _fit_backlash(search)
    names = [*(name for name, _ in named), *(BACKLASH for _ in play)]
    return _most_evidence_first(_refine_best(search, _best_by_cause(names, [*fits, *play])))


def _fit_backlash(search: Search) -> list[Fit]:
    """Of play that is off, from where it already explains more."""
    problem = search.problem
    if BACKLASH not in problem.causes or not overlaps_none(BACKLASH, search.fit.point.active):
        return []
    places = find_backlash_starts(problem, search.whitener, search.fit)
    return fit_starts(problem, search.whitener, places, BACKLASH_LINEARISATIONS)


def _best_by_cause(names: Sequence[str], fits: Sequence[Fit]) -> dict[str, Fit]:
    """The fit with most evidence of each cause."""
    best: dict[str, Fit] = {}
    for name, fit in zip(names, fits, strict=True):
        if name not in best or fit.evidence > best[name].evidence:
            best[name] = fit
    return best


def _most_evidence_first(fits: Mapping[str, Fit]) -> list[tuple[str, Fit]]:
    return sorted(fits.items(), key=lambda each: -each[1].evidence)


def rank_refits(
    problem: Problem, refits: Sequence[tuple[str, Fit]], settled: Fit
) -> list[tuple[str, Fit, float]]:
    """Refits with their gain, best first; the best is the one that no other leads, moment by moment."""
    ranked = sorted(
        ((name, fit, log_evidence_lead(problem, fit, settled)) for name, fit in refits),
        key=lambda each: -each[2],
    )
    first = 0
    for index in range(1, len(ranked)):
        if ranked[index][2] > gate(ranked[index][0]):
            first = index if log_evidence_lead(problem, ranked[index][1], ranked[first][1]) > 0.0 else first
    return [ranked[first], *ranked[:first], *ranked[first + 1 :]] if ranked else []


def _relative_starts(search: Search, names: Sequence[str]) -> list[tuple[str, Array]]:
    """The others of a family of which one is tried: where one is far off, a straight line misses the rest."""
    if not is_strained(search.fit):
        return []
    tried = {name.partition("@")[0] for name in names}
    found = [
        each for family in CONFOUNDED_FAMILIES if tried & set(family) for each in family if each not in names
    ]
    found = [each for each in found if each in search.problem.causes]
    found = [each for each in found if each not in search.fit.point.active]
    return [(name, np.array([u])) for name in found for u in RELATIVE_START_WIDTHS]


def split_lags(search: Search, part: float = 0.5) -> list[tuple[str, Point]]:
    """A lag that is on, a part of it given to each other lag in the same reading.

    Two lags d and e in a row act as one of d + e but for terms of the second order, so no straight line from
    the one points to the two.
    """
    point, causes = search.fit.point, search.problem.causes
    found = []
    for name, other in _lag_pairs(search):
        kept, u = (1.0 - part) * point.active[name], part * equal_lag(search, name, other)
        if u[0] > 0.0 or not causes[other].one_sided:  # a quicker filter is no latency in part
            found.append((other, point.with_cause(name, kept).with_cause(other, u)))
    return found


def equal_lag(search: Search, name: str, other: str) -> Array:
    """Coordinates at which another lag is as long as one that is on."""
    (own,), (coordinate,) = (search.problem.causes[each].coordinates for each in (name, other))
    return np.asarray(search.fit.point.active[name] * own.value(1.0) / coordinate.value(1.0), float)


def _lag_pairs(search: Search) -> Iterator[tuple[str, str]]:
    """Each lag that is on, with each other lag in the same reading that is off."""
    active, causes = search.fit.point.active, search.problem.causes
    for family in LAG_FAMILIES:
        for name in (each for each in active if each in family):
            yield from ((name, other) for other in family if other in causes and overlaps_none(other, active))


def is_strained(fit: Fit, deviations: float = STRAINED_STDS) -> bool:
    """Whether a base number is bent by more than that many standard deviations of robot.toml."""
    return bool((np.abs(fit.point.base) > deviations).any())


def may_miss_causes(fit: Fit) -> bool:
    """Whether causes may have gone unseen: columns are those of a point that is far from the true one."""
    return len(fit.point.active) >= SEVERAL_CAUSES or is_strained(fit, FAR_STRAINED_STDS)


def refit_relinearised(search: Search, refits: Sequence[tuple[str, Fit]]) -> list[tuple[str, Fit]]:
    """The refits, and those of causes that a straight line says less for, with every column simulated anew:
    beside several causes that are a little off, the columns of the point before lead astray. What is on or
    off, but not the other way round, is kinked, and tried from a small size as well, the more so where it
    went astray."""
    causes, point = search.problem.causes, search.fit.point
    starts = {name: [fit.point] for name, fit in refits[:MAX_REFITS_RELINEARISED]}
    for _, group, mean in screen_groups(search):
        name = group.name
        if len(starts) >= MAX_CAUSES_RELINEARISED:
            break
        if name in causes and name not in starts and overlaps_none(name, point.active):
            starts[name] = [point.with_cause(name, first_guess(search, group, mean))]
    for name, fit in refits:
        whole = name.partition("@")[0]
        if name in starts and whole != name and whole in causes and overlaps_none(whole, point.active):
            starts.setdefault(whole, []).append(point.with_cause(whole, fit.point.active[name]))
    astray = [name for name, fit in refits if fit.evidence < search.fit.evidence - ASTRAY_LOSS]
    named: list[tuple[str, Point | Fit]] = [(name, each) for name, own in starts.items() for each in own]
    small = [name for name in dict.fromkeys([*starts, *astray]) if causes[name].one_sided]
    named += _visible_small_starts(search, small)

    def lost(fit: Fit, foretold: float) -> bool:
        gained = PREDICTED_DECREASE_FACTOR * foretold
        hopeless = fit.evidence + gained < search.fit.evidence - HOPELESS_DEFICIT
        return hopeless and log_evidence_lead(search.problem, fit, search.fit) + gained < -HOPELESS_DEFICIT

    fits = fit_starts(search.problem, search.whitener, [each for _, each in named], 4, lost)
    return _most_evidence_first(_best_by_cause([name for name, _ in named], fits))


def _visible_small_starts(search: Search, names: Sequence[str]) -> Iterator[tuple[str, Fit]]:
    """Causes with the little of each that does anything: next to the point all but its own columns are those
    there. What is too little to show, as a dead zone below two counts, stands on level ground."""
    point, here = search.fit.point, search.fit.jacobian
    starts = [
        (name, each)
        for name in names
        for each in _small_starts(point, name, search.problem.causes[name].size - 1)
    ]
    seen = fit_with_frozen_columns(search.problem, search.whitener, [each for _, each in starts], here, 1)
    yield from (
        (name, fit) for (name, _), fit in zip(starts, seen, strict=True) if fit.jacobian[len(here) :].any()
    )


def _small_starts(point: Point, name: str, shapes: int) -> Iterator[Point]:
    """A point with a little of a cause; where it has shapes, with several of them."""
    for size in SMALL_SIZES:
        for shape in SMALL_SHAPES if shapes else SMALL_SHAPES[:1]:
            yield point.with_cause(name, np.array([size, *[shape] * shapes]))


def _refine_best(search: Search, fits: dict[str, Fit]) -> dict[str, Fit]:
    """The best refits once more with every column simulated anew, where base numbers are bent far.

    The columns of base numbers are those of the point before; a cause that relieves them changes them.
    """
    leads = {name: log_evidence_lead(search.problem, fit, search.fit) for name, fit in fits.items()}
    worth = sorted((name for name in fits if leads[name] > MIN_LEAD_TO_REFINE), key=lambda name: -leads[name])
    worth = [name for name in worth[:MAX_REFINED] if leads[name] > MIN_SHARE_OF_BEST_LEAD * leads[worth[0]]]
    if not is_strained(search.fit):
        return fits
    most = max(fits, key=lambda name: fits[name].evidence, default=None)
    if most and most not in worth and fits[most].evidence - search.fit.evidence > OVERWHELMING_EVIDENCE:
        worth.append(most)
    elif len(worth) < 2:
        return fits
    refined = fit_starts(search.problem, search.whitener, [fits[name].point for name in worth], 3)
    better = {name: fit for name, fit in zip(worth, refined, strict=True) if fit.cost <= fits[name].cost}
    return {**fits, **better}
