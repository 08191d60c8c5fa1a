"""Nonlinear refits of candidate causes: which candidates, from which starting points, and their ranking."""

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
"""Numbers of causes refitted under the whole noise, and under that without slowly varying friction."""
SHARED_SCALE_CAUSES = ("motor.armature_resistance", "drive.inertia", "friction.coulomb", "friction.viscous")
"""Without a measured current these share one scale, which only robot.toml's standard deviations determine."""
TURN_RATE_CAUSES = ("imu.gyro_scale", "motor.back_emf_constant")
"""Turn rate over back-EMF = gyro scale r / (b K_E), with wheel radius r and track width b; the causes of r
and b are twins of the gyro's scale."""
CONFOUNDED_FAMILIES = (SHARED_SCALE_CAUSES, TURN_RATE_CAUSES)
GYRO_LOW_PASS = "imu.low_pass"
"""The low-pass filter in the gyro's chip: a habit of the controller, not a cause."""
LAG_FAMILIES = (("imu.latency", "drive.wheel_slip", GYRO_LOW_PASS), ("actuation.latency", "bemf.filter_lag"))
"""Causes that delay the same readings; the parameter of each is a time in s."""
RELATIVE_START_WIDTHS = (-0.6, 0.6)
"""Widths at which refits of a cause's relatives start."""
STRAINED_STDS = 1.5
"""Standard deviations from robot.toml beyond which a base number is strained: something large is missing."""
FAR_STRAINED_STDS = 2.5
"""Standard deviations from robot.toml beyond which a base number shows that causes may have been missed."""
SEVERAL_CAUSES = 2
"""Number of active causes from which others may have been missed beside them."""
MAX_REFINED = 3
"""Maximum number of refits that are fitted again with new columns."""
MIN_LEAD_TO_REFINE = 8.0
"""Lead from which a refit is fitted again with new columns."""
OVERWHELMING_EVIDENCE = 300.0
"""Unlimited log evidence from which a refit is fitted again whatever its lead: if a cause explains so much in
a few moments, the base numbers are far off in all others."""
MAX_REFITS_RELINEARISED, MAX_CAUSES_RELINEARISED = 6, 10
"""Number of refits, and of causes in all, that are fitted once more with new columns before a search ends."""
SMALL_SIZES = (0.25, 0.03)
"""Widths from which a one-sided cause, whose response is kinked, is tried in these last fits: a fit of a
deadband of 0.0074 beside six other causes stopped at half of that and lost 2 of log evidence; from a quarter
width it gains 16. Backlash of 0.003 rad was not found from a quarter width, ten times as much."""
HOPELESS_DEFICIT, PREDICTED_DECREASE_FACTOR = 50.0, 2.0
"""A fit is stopped if it is behind by so much log evidence even with this multiple of the cost decrease
predicted for its next step. A deadband that gained four times the prediction was still a hundred behind."""
SMALL_SHAPES = (0.0, -0.6, 0.6)
"""Deviations of the shape from its usual value, in widths, at those starts: one backlash lost 250 of log
evidence with wheels that coast as far as usual, and gains 76 from a start at which they coast half as far."""
ASTRAY_LOSS = 5.0
"""Log evidence lost by a refit that went astray: a cause of nearly size zero loses less."""
BACKLASH_LINEARISATIONS = 8
"""Linearisations of a fit of backlash from its scan, since the misfit is a staircase."""
MIN_SHARE_OF_BEST_LEAD = 0.35
"""Share of the best refit's lead from which another refit may still become the best."""


def delay_same_reading(name: str, other: str) -> bool:
    """Whether two causes delay the same readings, so that a lag of one may as well be the other's."""
    return any({name, other} <= set(family) for family in LAG_FAMILIES)


def screen_candidates(search: Search) -> Screening:
    """The best variants of the causes that are worth a nonlinear refit.

    They are screened twice: under the whole noise, and without slowly varying friction, which resembles a
    change of friction so closely that only a nonlinear refit distinguishes them.
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
    """Coordinates at which a cause's refit starts: those of the linear model, clipped to a few widths."""
    cause = search.problem.causes[group.name]
    if not group.start:
        return np.clip(mean, -2.0, 2.0)
    first = float(np.clip(mean[0], 0.2 * group.start[0] if cause.one_sided else -3.0, 4.0))
    if len(cause.variants) > 1 and 0.6 < first / group.start[0] < 1.7:
        first = group.start[0]  # kinked: this size was simulated, others are interpolated
    return np.array([first, *group.start[1:]])


def both_signs(problem: Problem, name: str, point: tuple[float, ...]) -> list[tuple[float, ...]]:
    """A cause's coordinates, and, unless it is one-sided, the same with the opposite sign of the first."""
    if problem.causes[name].one_sided:
        return [point]
    return [point, (-point[0], *point[1:])]


def refit_candidates(search: Search) -> list[tuple[str, Fit]]:
    """Nonlinear refits of the most promising causes, one per cause, most evidence first."""
    chosen = [(group.name, first_guess(search, group, mean)) for _, group, mean in screen_candidates(search)]
    chosen.extend(_relative_starts(search, [name for name, _ in chosen]))
    named = [(name, search.fit.point.with_cause(name, u)) for name, u in chosen]
    named.extend(split_lags(search))
    if search.fit.point.active:  # before, the missing cause itself strains base numbers
        named.extend(causes_of_strained_numbers(search.problem, search.fit.point, FAR_STRAINED_STDS))
    starts = [start for _, start in named]
    fits = fit_with_frozen_columns(search.problem, search.whitener, starts, search.fit.jacobian, 4)
    play = _fit_backlash(search)
    names = [*(name for name, _ in named), *(BACKLASH for _ in play)]
    return _most_evidence_first(_refine_best(search, _best_by_cause(names, [*fits, *play])))


def _fit_backlash(search: Search) -> list[Fit]:
    """Fits of backlash, if it is inactive, from the points of a scan at which it explains more."""
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
    """Refits with their leads over the current fit, best first. The first is the one that no other leads in a
    direct comparison."""
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
    """Starting points of the other causes in the families of the candidates, if base numbers are strained:
    the linear model then does not show these relatives."""
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
    """Starting points at which an inactive lag takes over a share (`part`) of an active lag of the same
    reading, each with the name of the inactive one.

    Two lags d and e in a row act like one of d + e except for terms of second order, so no linear model
    around one lag leads to two.
    """
    point, causes = search.fit.point, search.problem.causes
    found = []
    for name, other in _lag_pairs(search):
        kept, u = (1.0 - part) * point.active[name], part * equal_lag(search, name, other)
        if u[0] > 0.0 or not causes[other].one_sided:  # a faster filter cannot be part of a latency
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
    """Whether a base number is more than so many standard deviations from robot.toml."""
    return bool((np.abs(fit.point.base) > deviations).any())


def may_miss_causes(fit: Fit) -> bool:
    """Whether causes may have been missed, because the columns belong to a point far from the true one."""
    return len(fit.point.active) >= SEVERAL_CAUSES or is_strained(fit, FAR_STRAINED_STDS)


def refit_relinearised(search: Search, refits: Sequence[tuple[str, Fit]]) -> list[tuple[str, Fit]]:
    """Refits of the given causes and of lower-ranked ones with new columns.

    Beside several causes that are slightly wrong, the columns of the previous point lead astray. One-sided
    causes have a kinked response and are tried from small sizes as well, also those whose refits went astray.
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
    """Starting points of causes at small sizes that change a reading, as fits: so near to the current point,
    the columns of all other coordinates are those of that point. A size without a visible effect, such as a
    dead zone below two counts, has columns of 0 and is left out."""
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
    """The point with each small size of a cause; with several shapes each if it has shape coordinates."""
    for size in SMALL_SIZES:
        for shape in SMALL_SHAPES if shapes else SMALL_SHAPES[:1]:
            yield point.with_cause(name, np.array([size, *[shape] * shapes]))


def _refine_best(search: Search, fits: dict[str, Fit]) -> dict[str, Fit]:
    """Fit the best refits once more with new columns if base numbers are strained.

    The columns of the base numbers were those of the previous point, and a cause that relieves base numbers
    changes them.
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
