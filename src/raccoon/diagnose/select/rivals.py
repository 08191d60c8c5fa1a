"""Rivals: causes that explain a recording nearly as well in the place of a named one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import cost_with_last_held, fit_point, fit_starts, fit_with_frozen_columns
from raccoon.diagnose.fit.linear_model import ColumnGroup
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import EVIDENCE_GATE, MANY_CAUSES, log_odds_against_another, total_gate
from raccoon.diagnose.select.one_way_drives import one_way_equivalents
from raccoon.diagnose.select.refits import GYRO_LOW_PASS, delay_same_reading, first_guess, split_lags
from raccoon.diagnose.select.set_scoring import SetScorer, overlaps_none
from raccoon.diagnose.select.state import Rival, Search
from raccoon.diagnose.select.twins import fit_twins

Array = NDArray[np.float64]
Replacement = tuple[float, ColumnGroup, Array]
"""A possible replacement of a cause: its rank (lowest first), the columns of the variant, and its
coordinates."""

MAX_LINEAR_DEFICIT = 20.0
"""Log evidence by which a rival may be behind in the linear model to be refitted."""
MIN_RIVAL_COSINE = 0.45
"""Threshold on the cosine of the responses, above which a rival is refitted as well."""
MAX_RIVAL_WIDTHS = 30.0
"""Largest size of a rival, in widths, however similar its response. If no reading shows a cause (a wheel's
radius without a gyro), its column is nearly zero and resembles any other, and thousands of its widths
replaced causes that act."""
MAX_RIVALS = 4
"""Maximum number of rivals of either kind (least loss, most similar) that are refitted for each cause."""
MIN_RIVALS = 2
"""Number of most similar rivals that are refitted however low their cosine: in a creeping drive
direction-dependent friction was as likely as the slope that was named, with a cosine of 0.38."""
MAX_CLASS_LEAD = EVIDENCE_GATE
"""Log evidence by which a rival may be behind to be named together with a cause, as a class: to be
distinguished from another one, a cause needs as much as to be named at all. Of 17 causes of blind robots that
led a rival by 3 to 12, 5 were wrong and the rival was the hidden cause, where the leads alone predict less
than one."""
LEAD_PER_E_FOLD = 5.0
"""Lead over a rival that makes a cause e times as likely as the rival: on blind robots the better of two was
right 12 times of 17 if it led by 3 to 12."""
MIN_NET_LEAD = 1.0
"""Lead, less the gates, that another set of causes needs to replace the present one."""
LAG_SHARE = 0.25
"""Share of a lag that is moved to another lag of the same reading; if that is nearly as likely, both are
named."""
MAX_LAG_STDS = 2.0
"""Bound, in standard deviations from the most likely split, for that share to be nearly as likely."""
MAX_DEFICIT_TO_REFINE = 15.0
"""Log evidence by which a rival may be behind to be refitted with new columns of the base numbers."""
MAX_DEFICIT_TO_RESTART = 25.0
"""Log evidence by which a rival may then still be behind to be fitted from other starts as well. Where wheels
break loose, a fit gets stuck in a valley along which it should go on: a quadratic drag in the place of a
viscous one was 0.2 behind; from fifteen starts fits ended 0.2 to 16 behind, and the first fit, which kept it
from being named, 19."""
RESTART_SCALES = (0.5, 0.0)
"""Factors on the fit's base coordinates at those starts."""


def compare_rivals(search: Search) -> Fit | None:
    """Fit the rivals of each cause in its place, everything else refitted, and record them in the search.

    Returns the fit that explains more than the present one, which may be one with a lag as the sum of two;
    None if there is none.
    """
    problem, whitener = search.problem, search.whitener
    starts = list(_rival_starts(search))
    search.rivals = {name: [] for name in search.fit.point.active}
    current = fit_point(problem, whitener, search.fit, 2)
    base = search.fit.jacobian[: len(problem.base)]
    fits = fit_with_frozen_columns(problem, whitener, [point for _, _, point in starts], base, 4)

    def deficit(fit: Fit) -> float:
        return log_evidence_lead(problem, current, fit)

    near = [index for index, fit in enumerate(fits) if deficit(fit) < MAX_DEFICIT_TO_REFINE]
    refined = fit_starts(problem, whitener, [fits[index].point for index in near], 3)
    for index, fit in zip(near, refined, strict=True):
        fits[index] = min(fits[index], fit, key=deficit)
    for index, fit in enumerate(fits):
        if MAX_CLASS_LEAD <= deficit(fit) < MAX_DEFICIT_TO_RESTART:
            fits[index] = min(fit, *_refit_from_restarts(search, fit), key=deficit)
    for (name, rival, _), fit in zip(starts, fits, strict=True):
        settings = problem.settings(fit.point)
        search.rivals[name].append(Rival(rival, deficit(fit), settings=settings, point=fit.point))
    for name, other, start, lag_deficit in _split_lag_deficits(search, current):
        search.rivals[name].append(Rival(other, lag_deficit, beside=True))
        if lag_deficit < 0.0:  # the lag may be two
            fits.append(fit_point(problem, whitener, start))
    fits.extend(_compare_twins(search, current))
    for each in search.rivals.values():
        each.sort(key=lambda rival: rival.lead)
    best = max(fits, key=lambda fit: net_lead(search, fit, current), default=current)
    return best if net_lead(search, best, current) > MIN_NET_LEAD else None


def mark_as_likely(search: Search, names: frozenset[str]) -> None:
    """Limit the lead of each cause over these rivals to at least 0: under the noise of either of the two sets
    the other one explains more, so neither is ahead."""
    for name, rivals in search.rivals.items():
        even = [replace(each, lead=max(each.lead, 0.0)) if each.name in names else each for each in rivals]
        search.rivals[name] = sorted(even, key=lambda rival: rival.lead)


def _refit_from_restarts(search: Search, fit: Fit) -> Iterator[Fit]:
    """Fits of the same causes from base numbers nearer to robot.toml's."""
    for scale in RESTART_SCALES:
        yield fit_point(search.problem, search.whitener, fit.point.shrunk(scale))


def _compare_twins(search: Search, current: Fit) -> list[Fit]:
    """Fit the twins of the set of causes. If one is nearly as likely, record its new causes as rivals of the
    cause that it omits. Its additional causes count against it.

    Its misfit is the same, so if many causes are named an additional one counts by the odds against a further
    cause, and not by the gate that protects against chance.
    """
    twins, active = fit_twins(search), search.fit.point.active
    candidates = len({each.id for each in search.problem.causes.values()})
    is_many = len(active) >= MANY_CAUSES
    discount = EVIDENCE_GATE - log_odds_against_another(len(active), candidates) if is_many else 0.0
    for name, fit in twins:
        new = [each for each in fit.point.active if each not in active]
        additional = max(len(fit.point.active) - len(active), 0)
        behind = -net_lead(search, fit, current)
        deficit = max(behind - additional * discount, min(behind, 0.0))  # the discount alone makes no lead
        for each in new if deficit < MAX_CLASS_LEAD else []:
            others = tuple(other for other in new if other != each)
            search.rivals[name] = [rival for rival in search.rivals[name] if rival.name != each]
            settings = search.problem.settings(fit.point)
            search.rivals[name].append(Rival(each, deficit, together=others, settings=settings))
    return [fit for _, fit in twins]


def _split_lag_deficits(search: Search, current: Fit) -> Iterator[tuple[str, str, Point, float]]:
    """Each lag of which a share (LAG_SHARE) may be another lag; that other lag, the point with both active,
    and by how much log evidence that point is behind.

    Base coordinates of the other lag are fixed: they would take back the share, and a lag that is well
    distinguished from the other would be reported as a sum of both.
    """
    problem, whitener = search.problem, search.whitener
    for other, start in split_lags(search, LAG_SHARE):
        name = next(each for each in search.rivals if delay_same_reading(each, other))
        held = problem.base_indices_of(other)
        deficit = 0.5 * (cost_with_last_held(problem, whitener, current, start, held) - current.cost)
        if deficit < 0.5 * MAX_LAG_STDS**2:
            yield name, other, start, deficit


def relative_odds(rival: Rival) -> float:
    """Odds of a rival, relative to 1 for the cause. Causes that together are one rival share its odds."""
    return math.exp(-max(rival.lead, -50.0) / LEAD_PER_E_FOLD) / (1 + len(rival.together))


def fault_probability(search: Search, name: str) -> float:
    """Probability that a cause is a fault: a lag may also be that of the gyro's own chip, which is none."""
    return 1.0 / (
        1.0 + sum(relative_odds(each) for each in search.rivals.get(name, []) if each.name == GYRO_LOW_PASS)
    )


def rivals_only_beside(search: Search, name: str, rivals: tuple[str, ...]) -> tuple[str, ...]:
    """Those of a cause's rivals that may take over a share of it, but do not explain as much in its place."""
    known = search.rivals.get(name, [])
    beside = {each.name for each in known if each.beside}
    instead = {each.name for each in known if not each.beside and each.lead < MAX_CLASS_LEAD}
    return tuple(each for each in rivals if each in beside - instead)


def net_lead(search: Search, fit: Fit, other: Fit) -> float:
    """Lead of a fit over another, each less the gates of its causes."""
    return (
        log_evidence_lead(search.problem, fit, other)
        - total_gate(fit.point.active)
        + total_gate(other.point.active)
    )


def _rival_starts(search: Search) -> Iterator[tuple[str, str, Point]]:
    """Each cause, a rival to try in its place, and the starting point of the rival's fit.

    Rivals are the causes that lose least in the linear model, and those with the most similar responses: the
    linear model says little about a cause that is far off, with which the base numbers change. For a cause of
    one side, the cause of both sides is a rival as well. So is what was nearly as likely when the cause was
    added: viscous friction, 0.5 behind quadratic drag then, was 37 behind in the linear model at that drag.
    """
    sets, point = SetScorer.of(search), search.fit.point
    for name, u in point.active.items():
        starts = find_similar_causes(
            search, name, MIN_RIVAL_COSINE, MAX_RIVALS, MIN_RIVALS
        ) | _cheapest_replacements(search, sets, name)
        less, whole = point.without_cause(name), name.partition("@")[0]
        if whole != name and whole in search.problem.causes and overlaps_none(whole, less.active):
            starts[whole] = less.with_cause(whole, u)
        starts |= dict(one_way_equivalents(search.problem, point, name)) | _known_rivals(search, name)
        yield from ((name, rival, start) for rival, start in starts.items())


def _known_rivals(search: Search, name: str) -> dict[str, Point]:
    """Points at which a cause is replaced by one that was nearly as likely in its place before, as fitted
    then; also with the base numbers of then, if the other causes are the same."""
    less, found = search.fit.point.without_cause(name), {}
    for each in search.rivals.get(name, []):
        if each.point is None or each.lead > MAX_DEFICIT_TO_REFINE or each.name not in each.point.active:
            continue
        if not overlaps_none(each.name, less.active):
            continue
        alike = each.point.active.keys() - {each.name} == less.active.keys()
        base = Point(each.point.base, less.active) if alike else less
        found[each.name] = base.with_cause(each.name, each.point.active[each.name])
    return found


def find_similar_causes(
    search: Search, name: str, min_cosine: float, max_count: int, min_count: int = 0
) -> dict[str, Point]:
    """Points at which a cause is replaced by one with a similar response, of the size that fits best; most
    similar first. Similarity is the cosine of the whitened responses. It must exceed `min_cosine`, except for
    the first `min_count`."""
    gram, own = search.table.gram, search.table.active[name]
    less = search.fit.point.without_cause(name)
    u = search.fit.point.active[name]
    projection = np.asarray(gram.matrix[:, own] @ u, float)
    power = max(float(u @ projection[own]), 1e-9)
    found: list[Replacement] = []
    for group, span in search.table.inactive:
        if group.name not in search.problem.causes:
            continue
        matrix = gram.matrix[np.ix_(span, span)] + 1e-9 * np.eye(len(span))
        size = np.asarray(np.linalg.solve(matrix, projection[span]), float)
        if np.abs(size).max() > MAX_RIVAL_WIDTHS:
            continue
        cosine = float(np.sqrt(max(projection[span] @ size, 0.0) / power))
        if cosine > 0.0 and not (group.one_sided and size[0] <= 0.0):
            found.append((-cosine, group, size))
    found.sort(key=lambda each: each[0])
    near = [each for number, each in enumerate(found) if number < min_count or -each[0] > min_cosine]
    return _replacement_starts(search, less, near, max_count)


def _cheapest_replacements(search: Search, sets: SetScorer, name: str) -> dict[str, Point]:
    """Points at which a cause is replaced by one that loses little log evidence in the linear model, least
    loss first."""
    current = frozenset(range(len(search.fit.point.active)))
    rest = frozenset(each for each in current if sets.members[each].name != name)
    _, evidence = sets.solve(current)
    found: list[Replacement] = []
    for index, member in enumerate(sets.members):
        if member.group is None:
            continue
        mean, replaced_evidence = sets.solve(rest | {index})
        if evidence - replaced_evidence < MAX_LINEAR_DEFICIT:
            found.append((evidence - replaced_evidence, member.group, mean[-len(member.span) :]))
    return _replacement_starts(search, search.fit.point.without_cause(name), found, MAX_RIVALS)


def _replacement_starts(
    search: Search, less: Point, others: list[Replacement], max_count: int
) -> dict[str, Point]:
    """Points with the first variant of each replacement added to the point without the cause."""
    found: dict[str, Point] = {}
    for _, group, u in sorted(others, key=lambda each: each[0]):
        if len(found) == max_count:
            break
        if group.name not in found and overlaps_none(group.name, less.active):
            found[group.name] = less.with_cause(group.name, first_guess(search, group, u))
    return found
