"""Nonlinear refits of candidate causes: which candidates, their starting points, and the fits by rank."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.backlash_scan import BACKLASH, find_backlash_starts
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_starts, fit_with_frozen_columns
from raccoon.diagnose.fit.linear_model import ColumnGroup
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.screening import Screening, screen_groups
from raccoon.diagnose.select.set_scoring import overlaps_none
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.symmetry import causes_of_strained_numbers

Array = NDArray[np.float64]

MAX_REFITS = 5
MAX_REFITS_WITHOUT_WANDER = 3
"""Causes that are refitted for their evidence under the whole noise, and under that without wandering
friction."""
SHARED_SCALE_CAUSES = ("motor.armature_resistance", "drive.inertia", "friction.coulomb", "friction.viscous")
"""Without a current reading these share one scale, which only robot.toml's standard deviations fix."""
TURN_RATE_CAUSES = ("imu.gyro_scale", "motor.back_emf_constant")
"""Turn rate over back-EMF = gyro scale r / (b K_E); the other twins are the gyro's."""
CONFOUNDED_FAMILIES = (SHARED_SCALE_CAUSES, TURN_RATE_CAUSES)
GYRO_LOW_PASS = "imu.low_pass"
"""A gyro whose chip filters: a habit of the controller, and no cause."""
LAG_FAMILIES = (("imu.latency", "drive.wheel_slip", GYRO_LOW_PASS), ("actuation.latency", "bemf.filter_lag"))
"""Causes that delay the same readings; the parameter of each is a time."""
RELATIVE_START_WIDTHS = (-0.6, 0.6)
"""Widths at which refits of a cause's relatives start."""
STRAINED_STDS = 1.5
"""Standard deviations from robot.toml from which a base number is strained: something large is missing."""
FAR_STRAINED_STDS = 2.5
"""The same where causes may have been missed."""
SEVERAL_CAUSES = 2
"""Active causes from which others may have been missed beside them."""
MAX_REFINED = 3
"""Most refits that are refined."""
MIN_LEAD_TO_REFINE = 8.0
"""Log evidence that a refit must add to be refined."""
OVERWHELMING_EVIDENCE = 300.0
"""Log evidence with no event limited from which a refit is refined whatever its lead: base numbers are then
far off in all but the few moments in which it acts."""
MAX_REFITS_RELINEARISED, MAX_CAUSES_RELINEARISED = 6, 10
"""Refits, and causes in all, that are fitted once more with new columns before a search ends."""
SMALL_SIZES = (0.25, 0.03)
"""Widths from which a one-sided cause, whose response is kinked, is then tried: a fit of a deadband of 0.0074
beside six other causes stopped at half of it and lost 2 of log evidence, where from a quarter width it adds
16. Play of 0.003 rad was lost from a quarter width, ten times as much."""
HOPELESS_DEFICIT, PREDICTED_DECREASE_FACTOR = 50.0, 2.0
"""A fit is given up when it lacks so much log evidence, even with so many times the cost decrease that is
predicted for its next step. A deadband that gained four times what was predicted still lacked a hundred."""
SMALL_SHAPES = (0.0, -0.6, 0.6)
"""Widths of the shape from its usual value at those starts: that play was lost, by 250 of log evidence,
beside wheels that coast as far as usual, and adds 76 from where they coast half as far."""
ASTRAY_LOSS = 5.0
"""Log evidence lost over the fit without the cause from which a refit went astray, since a cause of next to
no size costs less."""
BACKLASH_LINEARISATIONS = 8
"""Linearisations of a fit of play from its scan, whose misfit is a staircase."""
MIN_SHARE_OF_BEST_LEAD = 0.35
"""Share of the best refit's lead from which another may still become the best."""


def delay_same_reading(name: str, other: str) -> bool:
    """Whether two causes delay the same readings, so that what one adds is as well the other's."""
    return any({name, other} <= set(family) for family in LAG_FAMILIES)


def screen_candidates(search: Search) -> Screening:
    """The best variants of the causes worth a nonlinear refit.

    Screened twice: under the full noise model, and without wandering friction, which resembles a change of
    friction so closely that only a nonlinear refit distinguishes them.
    """
    chosen: Screening = []
    tables = (search.table, MAX_REFITS), (search.table_without_wander, MAX_REFITS_WITHOUT_WANDER)
    for table, max_refits in tables:
        variants: dict[str, int] = {}
        for gain, group, mean in screen_groups(search, table):
            if group.name not in search.problem.causes or not overlaps_none(
                group.name, search.fit.point.active
            ):
                continue
            count = variants.get(group.name, 0)
            if gain < 1.0 or count >= 2 or (count == 0 and len(variants) >= max_refits):
                continue
            variants[group.name] = count + 1
            if not any(group is other for _, other, _ in chosen):
                chosen.append((gain, group, mean))
    return chosen


def first_guess(search: Search, group: ColumnGroup, mean: Array) -> Array:
    """Coordinates at which to start a cause's refit: the linear model's, clipped to a few widths."""
    cause = search.problem.causes[group.name]
    if not group.start:
        return np.clip(mean, -2.0, 2.0)
    first = float(np.clip(mean[0], 0.2 * group.start[0] if cause.one_sided else -3.0, 4.0))
    if len(cause.variants) > 1 and 0.6 < first / group.start[0] < 1.7:
        first = group.start[0]  # kinked: this guess was simulated, what is between is only interpolated
    return np.array([first, *group.start[1:]])


def both_signs(problem: Problem, name: str, point: tuple[float, ...]) -> list[tuple[float, ...]]:
    """A cause's coordinates, and, unless it is one-sided, those with the first one's sign changed."""
    if problem.causes[name].one_sided:
        return [point]
    return [point, (-point[0], *point[1:])]


def refit_candidates(search: Search) -> list[tuple[str, Fit]]:
    """Nonlinear refits of the most promising causes, one per cause, most evidence first."""
    chosen = [(group.name, first_guess(search, group, mean)) for _, group, mean in screen_candidates(search)]
    chosen.extend(_relative_starts(search, [name for name, _ in chosen]))
    named = [(name, search.fit.point.with_cause(name, u)) for name, u in chosen]
    named.extend(split_lags(search))
    if search.fit.point.active:  # before, the cause that is searched for strains everything
        named.extend(causes_of_strained_numbers(search.problem, search.fit.point, FAR_STRAINED_STDS))
    starts = [start for _, start in named]
    fits = fit_with_frozen_columns(search.problem, search.whitener, starts, search.fit.jacobian, 4)
    play = _fit_backlash(search)
    names = [*(name for name, _ in named), *(BACKLASH for _ in play)]
    return _most_evidence_first(_refine_best(search, _best_by_cause(names, [*fits, *play])))


def _fit_backlash(search: Search) -> list[Fit]:
    """Fits of play, where it is inactive, from the places of a scan at which it explains more."""
    problem = search.problem
    if BACKLASH not in problem.causes or not overlaps_none(BACKLASH, search.fit.point.active):
        return []
    starts = find_backlash_starts(problem, search.whitener, search.fit)
    return fit_starts(problem, search.whitener, starts, BACKLASH_LINEARISATIONS)


def _best_by_cause(names: Sequence[str], fits: Sequence[Fit]) -> dict[str, Fit]:
    """For each cause the fit with most evidence."""
    best: dict[str, Fit] = {}
    for name, fit in zip(names, fits, strict=True):
        if name not in best or fit.evidence > best[name].evidence:
            best[name] = fit
    return best


def _most_evidence_first(fits: Mapping[str, Fit]) -> list[tuple[str, Fit]]:
    return sorted(fits.items(), key=lambda each: -each[1].evidence)


def rank_refits(
    problem: Problem, refits: Sequence[tuple[str, Fit]], current: Fit
) -> list[tuple[str, Fit, float]]:
    """Refits with their leads over the current fit, best first; the best is that which no other leads when
    the two are compared directly."""
    ranked = sorted(
        ((name, fit, log_evidence_lead(problem, fit, current)) for name, fit in refits),
        key=lambda each: -each[2],
    )
    best = 0
    for index in range(1, len(ranked)):
        if ranked[index][2] > gate(ranked[index][0]):
            best = index if log_evidence_lead(problem, ranked[index][1], ranked[best][1]) > 0.0 else best
    return [ranked[best], *ranked[:best], *ranked[best + 1 :]] if ranked else []


def _relative_starts(search: Search, names: Sequence[str]) -> list[tuple[str, Array]]:
    """Starts of the other causes of a family of which one is tried: where one is far off, the linear model
    misses the rest."""
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
    """Starts at which each inactive lag takes over a part of an active lag of the same reading, by name.

    Two lags d and e in a row act as one of d + e but for terms of the second order, so no linear model around
    the one points to the two.
    """
    point, causes = search.fit.point, search.problem.causes
    found = []
    for name, other in _lag_pairs(search):
        kept, u = (1.0 - part) * point.active[name], part * equal_lag(search, name, other)
        if u[0] > 0.0 or not causes[other].one_sided:  # no part of a faster filter is a latency
            found.append((other, point.with_cause(name, kept).with_cause(other, u)))
    return found


def equal_lag(search: Search, name: str, other: str) -> Array:
    """Coordinates at which another lag is as long as an active one."""
    (own,), (coordinate,) = (search.problem.causes[each].coordinates for each in (name, other))
    return np.asarray(search.fit.point.active[name] * own.value(1.0) / coordinate.value(1.0), float)


def _lag_pairs(search: Search) -> Iterator[tuple[str, str]]:
    """Each active lag with each inactive lag of the same reading."""
    active, causes = search.fit.point.active, search.problem.causes
    for family in LAG_FAMILIES:
        for name in (each for each in active if each in family):
            yield from ((name, other) for other in family if other in causes and overlaps_none(other, active))


def is_strained(fit: Fit, deviations: float = STRAINED_STDS) -> bool:
    """Whether a base number is more than that many standard deviations from robot.toml."""
    return bool((np.abs(fit.point.base) > deviations).any())


def may_miss_causes(fit: Fit) -> bool:
    """Whether causes may have been missed: the columns are those of a point far from the true one."""
    return len(fit.point.active) >= SEVERAL_CAUSES or is_strained(fit, FAR_STRAINED_STDS)


def refit_relinearised(search: Search, refits: Sequence[tuple[str, Fit]]) -> list[tuple[str, Fit]]:
    """Refits of the given causes and of lower-ranked ones, with every column simulated anew.

    Beside several causes that are a little off, the columns of the point before lead astray. One-sided causes
    have a kinked response and are tried from a small size as well, also those whose refits went astray.
    """
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
    candidates: list[tuple[str, Point | Fit]] = [(name, each) for name, own in starts.items() for each in own]
    kinked = [name for name in dict.fromkeys([*starts, *astray]) if causes[name].one_sided]
    candidates += _visible_small_starts(search, kinked)

    def is_hopeless(fit: Fit, predicted_decrease: float) -> bool:
        gain = PREDICTED_DECREASE_FACTOR * predicted_decrease
        lacks = fit.evidence + gain < search.fit.evidence - HOPELESS_DEFICIT
        return lacks and log_evidence_lead(search.problem, fit, search.fit) + gain < -HOPELESS_DEFICIT

    fits = fit_starts(search.problem, search.whitener, [each for _, each in candidates], 4, is_hopeless)
    return _most_evidence_first(_best_by_cause([name for name, _ in candidates], fits))


def _visible_small_starts(search: Search, names: Sequence[str]) -> Iterator[tuple[str, Fit]]:
    """Starts of causes at small sizes that change a reading, as fits: so near to the point, the columns of
    all other coordinates are those of the point. A size too small to show, as of a dead zone below two
    counts, has columns of 0 and is left out."""
    point, frozen = search.fit.point, search.fit.jacobian
    starts = [
        (name, each)
        for name in names
        for each in _small_starts(point, name, search.problem.causes[name].size - 1)
    ]
    fits = fit_with_frozen_columns(search.problem, search.whitener, [each for _, each in starts], frozen, 1)
    yield from (
        (name, fit) for (name, _), fit in zip(starts, fits, strict=True) if fit.jacobian[len(frozen) :].any()
    )


def _small_starts(point: Point, name: str, shapes: int) -> Iterator[Point]:
    """The point with small sizes of a cause; where that has shape coordinates, with several shapes."""
    for size in SMALL_SIZES:
        for shape in SMALL_SHAPES if shapes else SMALL_SHAPES[:1]:
            yield point.with_cause(name, np.array([size, *[shape] * shapes]))


def _refine_best(search: Search, fits: dict[str, Fit]) -> dict[str, Fit]:
    """Refit the best once more with every column simulated anew, where base numbers are strained.

    The columns of base numbers were those of the point before; a cause that relieves them changes them.
    """
    leads = {name: log_evidence_lead(search.problem, fit, search.fit) for name, fit in fits.items()}
    best = sorted((name for name in fits if leads[name] > MIN_LEAD_TO_REFINE), key=lambda name: -leads[name])
    best = [name for name in best[:MAX_REFINED] if leads[name] > MIN_SHARE_OF_BEST_LEAD * leads[best[0]]]
    if not is_strained(search.fit):
        return fits
    likeliest = max(fits, key=lambda name: fits[name].evidence, default=None)
    max_evidence = max((fit.evidence for fit in fits.values()), default=0.0)
    if likeliest and likeliest not in best and max_evidence - search.fit.evidence > OVERWHELMING_EVIDENCE:
        best.append(likeliest)
    elif len(best) < 2:
        return fits
    refined = fit_starts(search.problem, search.whitener, [fits[name].point for name in best], 3)
    better = {name: fit for name, fit in zip(best, refined, strict=True) if fit.cost <= fits[name].cost}
    return {**fits, **better}
