"""What would explain a recording nearly as well in the place of a cause that was named."""

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
"""What may stand in a cause's place, the lower the number the sooner: which variant, and how far off."""

MAX_LINEAR_DEFICIT = 20.0
"""Log evidence that a rival may lack by the linear model, to be truly fitted."""
MIN_RIVAL_COSINE = 0.45
"""Cosine from which it is truly fitted as well."""
MAX_RIVAL_WIDTHS = 30.0
"""Widths from which what would have to be that far off is no rival, however much alike: where no reading
shows a cause, as without a gyro a wheel's radius, its column of next to nothing is like any other, and
thousands of its widths took the places of those that act."""
MAX_RIVALS = 4
"""Of either kind, in the place of one cause."""
MIN_RIVALS = 2
"""Most alike ones that are truly fitted however little alike they are: in a creeping drive friction that
differs between the directions was as likely as the slope that was named, and its cosine was 0.38."""
MAX_CLASS_LEAD = EVIDENCE_GATE
"""Log evidence that a rival may lack to be named with a cause, as a class: to be told from another a cause
needs what it needs to be named at all. Of 17 causes of blind robots that led a rival by 3 to 12, 5 were
wrong and the rival was hidden, where leads alone let expect less than one."""
LEAD_PER_E_FOLD = 5.0
"""Lead over a rival that makes a cause e times as likely as that: on blind robots the better of two was right
12 times of 17 where it led by 3 to 12."""
MIN_NET_LEAD = 1.0
"""Log evidence beyond the gates that another set must have more."""
LAG_PART = 0.25
"""Of a lag, what may as well be another that delays the same reading, for both to be named."""
MAX_LAG_STDS = 2.0
"""Within how many, of what is likeliest."""
MAX_DEFICIT_TO_REFINE = 15.0
"""Log evidence that one may lack before base numbers' columns are simulated anew beside it."""
MAX_DEFICIT_TO_RESTART = 25.0
"""Log evidence that one may lack in the end to be fitted from elsewhere as well. Where wheels break loose a
fit stands still in a valley that it should go along: a quadratic drag in a viscous one's place lacked 0.2,
from fifteen starts 0.2 to 16, and 19 from where it would have been named with it."""
RESTART_SCALES = (0.5, 0.0)
"""Parts of what base numbers are off by from which such a fit starts."""


def compare_rivals(search: Search) -> Fit | None:
    """Note the rivals of each cause, truly fitted in its place, all else refitted. Returned is one that after
    all explains more, a lag as the sum of two among them; None where there is none."""
    problem, whitener = search.problem, search.whitener
    search.rivals = {name: [] for name in search.fit.point.active}
    tried = list(_rival_starts(search))
    settled = fit_point(problem, whitener, search.fit, 2)
    base = search.fit.jacobian[: len(problem.base)]
    fits = fit_with_frozen_columns(problem, whitener, [point for _, _, point in tried], base, 4)

    def lacks(fit: Fit) -> float:
        return log_evidence_lead(problem, settled, fit)

    near = [index for index, fit in enumerate(fits) if lacks(fit) < MAX_DEFICIT_TO_REFINE]
    afresh = fit_starts(problem, whitener, [fits[index].point for index in near], 3)
    for index, fit in zip(near, afresh, strict=True):
        fits[index] = min(fits[index], fit, key=lacks)
    for index, fit in enumerate(fits):
        if MAX_CLASS_LEAD <= lacks(fit) < MAX_DEFICIT_TO_RESTART:
            fits[index] = min(fit, *_refit_from_restarts(search, fit), key=lacks)
    for (name, rival, _), fit in zip(tried, fits, strict=True):
        search.rivals[name].append(Rival(rival, lacks(fit), settings=problem.settings(fit.point)))
    for name, other, start, lacking in _lag_sums(search, settled):
        search.rivals[name].append(Rival(other, lacking, beside=True))
        if lacking < 0.0:  # the lag may be two
            fits.append(fit_point(problem, whitener, start))
    fits.extend(_compare_twins(search, settled))
    for each in search.rivals.values():
        each.sort(key=lambda rival: rival.lead)
    best = max(fits, key=lambda fit: net_lead(search, fit, settled), default=settled)
    return best if net_lead(search, best, settled) > MIN_NET_LEAD else None


def mark_as_likely(search: Search, names: frozenset[str]) -> None:
    """Let none of these outdo the cause in whose place it stands: under the noise of each set the other one
    explains more, so neither does."""
    for name, its in search.rivals.items():
        even = [replace(each, lead=max(each.lead, 0.0)) if each.name in names else each for each in its]
        search.rivals[name] = sorted(even, key=lambda rival: rival.lead)


def _refit_from_restarts(search: Search, fit: Fit) -> Iterator[Fit]:
    """The same causes, fitted from where base numbers are nearer to robot.toml's."""
    for part in RESTART_SCALES:
        yield fit_point(search.problem, search.whitener, fit.point.shrunk(part))


def _compare_twins(search: Search, settled: Fit) -> list[Fit]:
    """The sets that are the same drive in other numbers, fitted. What is new in one stands, all together, in
    the place of the cause that it does without, as far as it is as likely; what it needs more counts.

    Its misfit is the same, so where many are named a cause more counts by how rare causes are, instead of by
    what chance makes of a drive.
    """
    twins, now = fit_twins(search), search.fit.point.active
    asked = len({each.id for each in search.problem.causes.values()})
    spared = EVIDENCE_GATE - log_odds_against_another(len(now), asked) if len(now) >= MANY_CAUSES else 0.0
    for name, fit in twins:
        new = [each for each in fit.point.active if each not in now]
        more = max(len(fit.point.active) - len(now), 0)
        behind = -net_lead(search, fit, settled)
        lacking = max(behind - more * spared, min(behind, 0.0))  # no lead comes of what is spared
        for each in new if lacking < MAX_CLASS_LEAD else []:
            others = tuple(other for other in new if other != each)
            search.rivals[name] = [rival for rival in search.rivals[name] if rival.name != each]
            there = search.problem.settings(fit.point)
            search.rivals[name].append(Rival(each, lacking, together=others, settings=there))
    return [fit for _, fit in twins]


def _lag_sums(search: Search, settled: Fit) -> Iterator[tuple[str, str, Point, float]]:
    """Each lag of which another may be a good part, that other, where both are on, and the log evidence that
    this lacks.

    What robot.toml leaves open of that other stays: it would take back what the lag gives away, and the lag
    would be said to be the sum of both, where it is told from the other well.
    """
    problem, whitener = search.problem, search.whitener
    for other, start in split_lags(search, LAG_PART):
        name = next(each for each in search.rivals if delay_same_reading(each, other))
        held = problem.base_indices_of(other)
        lacks = 0.5 * (cost_with_last_held(problem, whitener, settled, start, held) - settled.cost)
        if lacks < 0.5 * MAX_LAG_STDS**2:
            yield name, other, start, lacks


def relative_odds(rival: Rival) -> float:
    """How likely a rival is where the cause is 1. Several that are one rival together have a part each."""
    return math.exp(-max(rival.lead, -50.0) / LEAD_PER_E_FOLD) / (1 + len(rival.together))


def fault_probability(search: Search, name: str) -> float:
    """How likely what a cause does is a fault: a lag may as well be that of the gyro's own chip, which is
    none."""
    return 1.0 / (
        1.0 + sum(relative_odds(each) for each in search.rivals.get(name, []) if each.name == GYRO_LOW_PASS)
    )


def rivals_only_beside(search: Search, name: str, rivals: tuple[str, ...]) -> tuple[str, ...]:
    """Of a cause's rivals those that may have a part of it, and do not explain as well in its place."""
    tried = search.rivals.get(name, [])
    parts = {each.name for each in tried if each.beside}
    instead = {each.name for each in tried if not each.beside and each.lead < MAX_CLASS_LEAD}
    return tuple(each for each in rivals if each in parts - instead)


def net_lead(search: Search, fit: Fit, settled: Fit) -> float:
    """Log evidence of a fit over another, each less the gates of its causes."""
    return (
        log_evidence_lead(search.problem, fit, settled)
        - total_gate(fit.point.active)
        + total_gate(settled.point.active)
    )


def _rival_starts(search: Search) -> Iterator[tuple[str, str, Point]]:
    """Each cause, what might stand in its place, and where to start the fit of that.

    What loses least by the linear model, and what acts most like the cause: straight lines say little of a
    cause that is far off, beside which base numbers move. Of a cause of one side also that of both.
    """
    sets, point = SetScorer.of(search), search.fit.point
    for name, u in point.active.items():
        near = find_similar_causes(
            search, name, MIN_RIVAL_COSINE, MAX_RIVALS, MIN_RIVALS
        ) | _cheapest_replacements(search, sets, name)
        less, whole = point.without_cause(name), name.partition("@")[0]
        if whole != name and whole in search.problem.causes and overlaps_none(whole, less.active):
            near[whole] = less.with_cause(whole, u)
        near |= dict(one_way_equivalents(search.problem, point, name))
        yield from ((name, rival, start) for rival, start in near.items())


def find_similar_causes(
    search: Search, name: str, least: float, most: int, fewest: int = 0
) -> dict[str, Point]:
    """A cause replaced by what acts most like it, as far as that would have to be off, most alike first: by
    the cosine of the whitened responses, which is above `least` but for the `fewest` that are most alike."""
    whole, own = search.table.gram, search.table.active[name]
    less = search.fit.point.without_cause(name)
    u = search.fit.point.active[name]
    pull = np.asarray(whole.matrix[:, own] @ u, float)
    size = max(float(u @ pull[own]), 1e-9)
    found: list[Replacement] = []
    for group, span in search.table.inactive:
        if group.name not in search.problem.causes:
            continue
        matrix = whole.matrix[np.ix_(span, span)] + 1e-9 * np.eye(len(span))
        moved = np.asarray(np.linalg.solve(matrix, pull[span]), float)
        if np.abs(moved).max() > MAX_RIVAL_WIDTHS:
            continue
        cosine = float(np.sqrt(max(pull[span] @ moved, 0.0) / size))
        if cosine > 0.0 and not (group.one_sided and moved[0] <= 0.0):
            found.append((-cosine, group, moved))
    found.sort(key=lambda each: each[0])
    near = [each for number, each in enumerate(found) if number < fewest or -each[0] > least]
    return _replacement_starts(search, less, near, most)


def _cheapest_replacements(search: Search, sets: SetScorer, name: str) -> dict[str, Point]:
    """A cause replaced by what costs least log evidence by the linear model, least first."""
    now = frozenset(range(len(search.fit.point.active)))
    rest = frozenset(each for each in now if sets.members[each].name != name)
    _, evidence = sets.solve(now)
    found: list[Replacement] = []
    for index, member in enumerate(sets.members):
        if member.group is None:
            continue
        mean, its = sets.solve(rest | {index})
        if evidence - its < MAX_LINEAR_DEFICIT:
            found.append((evidence - its, member.group, mean[-len(member.span) :]))
    return _replacement_starts(search, search.fit.point.without_cause(name), found, MAX_RIVALS)


def _replacement_starts(
    search: Search, less: Point, others: list[Replacement], most: int
) -> dict[str, Point]:
    """The first variant each of so many others, beside what is left of the point."""
    found: dict[str, Point] = {}
    for _, group, u in sorted(others, key=lambda each: each[0]):
        if len(found) == most:
            break
        if group.name not in found and overlaps_none(group.name, less.active):
            found[group.name] = less.with_cause(group.name, first_guess(search, group, u))
    return found
