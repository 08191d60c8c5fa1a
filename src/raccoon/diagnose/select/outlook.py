"""What can be seen from one working point: fit, noise, columns in every direction, and who is worth a
refit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.evidence import Gram, cross_validated
from raccoon.diagnose.fit import Fit, fit_many, fit_point, unbound
from raccoon.diagnose.linear import BLOCKS, Group, Linear, Table, linearise, tabulate
from raccoon.diagnose.noise import EVENT
from raccoon.diagnose.problem import Point, Problem, Whitener
from raccoon.diagnose.whitening import whitener_for

Array = NDArray[np.float64]

LEAST_OF_PROBE = 10.0
"""Log evidence of the linear model from which a probe is looked at closely."""
PROBES_TRIED = 3
NEARLY = 0.7
"""Part of the best probe's lead, which many events saturate, from which the whole evidence decides."""
MOST_OF_EVENT = 4.0
"""Log evidence that half a second may give."""
REFITS = 5
PLAIN_REFITS = 3
SCALE = ("motor.armature_resistance", "drive.inertia", "friction.coulomb", "friction.viscous")
"""Without a current reading these share one scale, which only robot.toml's standard deviations fix."""
TURN = ("imu.gyro_scale", "motor.back_emf_constant")
"""Turn rate over back-EMF = gyro scale r / (b K_E); the other twins are the gyro's."""
FAMILIES = (SCALE, TURN)
RELATIVES_STARTS = (-0.6, 0.6)
STRAINED = 1.5
"""Standard deviations of robot.toml by which a base number is bent where something large is missing."""
POLISHED = 3
WORTH_POLISHING = 8.0
"""Log evidence that a refit must add to be refined."""
CLOSE_ENOUGH = 0.35
"""Part of the best one's, from which a refit may still become the best."""


@dataclass(frozen=True, slots=True)
class Rival:
    """Another cause that was tried in the place of one that was taken. lead: log evidence it lacks."""

    name: str
    lead: float


@dataclass(slots=True)
class Search:
    """State of the search, and what it found in the end.

    gains: log evidence that each cause adds to all others. held_out: the same on blocks that were not fitted.
    rivals: causes that explain nearly as much in its place. screened: best linear gain of each cause that
    is off.
    unknown: probes that explain what no cause does, with the evidence they add.
    """

    problem: Problem
    probes: Callable[[Linear], Sequence[Group]]
    fit: Fit
    whitener: Whitener
    linear: Linear
    table: Table
    plain: Table
    gains: dict[str, float] = field(default_factory=dict)
    held_out: dict[str, float] = field(default_factory=dict)
    rivals: dict[str, list[Rival]] = field(default_factory=dict)
    screened: dict[str, float] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    unknown: dict[str, float] = field(default_factory=dict)


def blocks_of(fit: Fit) -> list[Gram]:
    """Gram numbers of a fit by blocks of time."""
    edges = np.linspace(0, len(fit.white), BLOCKS + 1).astype(int)
    target, columns = fit.target, fit.jacobian[fit.free]
    return [Gram.of(columns[:, a:b].T, target[a:b]) for a, b in pairwise(edges)]


def held_out_score(fit: Fit) -> float:
    """Log predictive score of the blocks, each predicted from the others, and of robot.toml's measurements.

    What robot.toml says with a standard deviation is data as well: a fit that bends it pays for it here.
    """
    base = fit.point.base
    return -0.5 * float(base @ base) + cross_validated(blocks_of(fit), range(int(fit.free.sum())))


def start_search(problem: Problem, probes: Callable[[Linear], Sequence[Group]]) -> Search:
    """Fit what robot.toml leaves open, and look in every direction from there."""
    names = list(problem.causes)
    linear = linearise(problem, problem.nominal(), names)
    whitener = whitener_for(problem, linear, probes(linear), None)
    fit = fit_point(problem, whitener, problem.nominal())
    return look_around(problem, probes, fit.point, whitener)


def look_around(
    problem: Problem,
    probes: Callable[[Linear], Sequence[Group]],
    point: Point,
    before: Whitener,
    unknown: Mapping[str, float] | None = None,
) -> Search:
    """Columns in every direction at a point, the noise that they leave, and the fit under it."""
    linear = linearise(problem, point, list(problem.causes))
    extra = probes(linear)
    whitener = whitener_for(problem, linear, extra, before, tuple(unknown or ()))
    table, plain = tabulate(linear, extra, whitener, len(problem.base))
    white = whitener(np.concatenate([linear.residual[None], linear.own]))
    vector = point.vector()
    cost = float(white[0] @ white[0] + vector @ vector)
    fit = Fit(point, white[0], white[1:], cost, unbound(problem, point))
    return Search(problem, probes, fit, whitener, linear, table, plain, unknown=dict(unknown or {}))


def estimated(search: Search) -> Search:
    """The same causes fitted once more, now that the search is over: nothing that an effect does counts as
    noise."""
    problem, extra = search.problem, search.probes(search.linear)
    unknown = tuple(search.unknown)
    whitener = whitener_for(problem, search.linear, extra, search.whitener, unknown, tolerant=False)
    fit = fit_point(problem, whitener, search.fit.point)
    residual = problem.features.measured - problem.predict([fit.point])[0]
    linear = replace(search.linear, residual=residual)
    return replace(search, fit=fit, whitener=whitener, linear=linear)


Screened = list[tuple[float, Group, Array]]


def screen(search: Search, table: Table | None = None) -> Screened:
    """Evidence that each cause that is off would add, by the linear model; best first."""
    table = search.table if table is None else table
    free = search.fit.free
    always = [int(i) for i in np.flatnonzero(free)]
    held = np.zeros(len(table.whole.projection))
    held[: len(free)] = np.where(free, 0.0, search.fit.point.vector())
    whole = table.whole.shifted(held)
    rest = whole.take([*always, *(i for _, span in table.off for i in span)]).without(len(always))
    found, position = [], 0
    for group, span in table.off:
        chosen = rest.take(range(position, position + len(span)))
        position += len(span)
        mean, gain, _ = chosen.solve()
        if group.one_sided and mean[0] <= 0.0:
            continue
        found.append((gain, group, mean))
    found.sort(key=lambda each: -each[0])
    return found


def candidates(search: Search) -> Screened:
    """The best variants of the causes worth a true refit.

    Screened twice: under the full noise model, and without wandering friction, which resembles a change of
    friction so closely that only a true refit tells them apart.
    """
    chosen: Screened = []
    for table, most in ((search.table, REFITS), (search.plain, PLAIN_REFITS)):
        seen: dict[str, int] = {}
        for gain, group, mean in screen(search, table):
            if group.name not in search.problem.causes:
                continue
            if table is search.table:
                search.screened.setdefault(group.name, gain)
            count = seen.get(group.name, 0)
            if gain < 1.0 or count >= 2 or (count == 0 and len(seen) >= most):
                continue
            seen[group.name] = count + 1
            if not any(group is other for _, other, _ in chosen):
                chosen.append((gain, group, mean))
    return chosen


def first_guess(search: Search, group: Group, mean: Array) -> Array:
    """Coordinates at which to start a cause's refit: as far as the linear model says, within a width or
    two."""
    cause = search.problem.causes[group.name]
    if not group.start:
        return np.clip(mean, -2.0, 2.0)
    low = cause.coordinates[0].low
    first = float(np.clip(mean[0], 0.2 * group.start[0] if low == 0.0 else -3.0, 4.0))
    if len(cause.variants) > 1 and 0.6 < first / group.start[0] < 1.7:
        first = group.start[0]  # kinked: the guess was simulated, what lies between is only a straight line
    return np.array([first, *group.start[1:]])


def refit_candidates(search: Search) -> list[tuple[str, Fit]]:
    """True refits of the most promising causes, best evidence first, one a cause."""
    chosen = [(group.name, first_guess(search, group, mean)) for _, group, mean in candidates(search)]
    chosen.extend(_relatives(search, [name for name, _ in chosen]))
    if not chosen:
        return []
    starts = [search.fit.point.with_cause(name, u) for name, u in chosen]
    fits = fit_many(search.problem, search.whitener, starts, search.fit.jacobian, 4)
    best: dict[str, Fit] = {}
    for (name, _), fit in zip(chosen, fits, strict=True):
        if name not in best or fit.evidence > best[name].evidence:
            best[name] = fit
    best = _polished(search, best)
    return sorted(best.items(), key=lambda each: -each[1].evidence)


def _relatives(search: Search, names: Sequence[str]) -> list[tuple[str, Array]]:
    """The others of a family of which one is tried: where one is far off, a straight line misses the rest."""
    if not strained(search.fit):
        return []
    tried = {name.partition("@")[0] for name in names}
    found = [each for family in FAMILIES if tried & set(family) for each in family if each not in names]
    found = [each for each in found if each in search.problem.causes]
    found = [each for each in found if each not in search.fit.point.active]
    return [(name, np.array([u])) for name in found for u in RELATIVES_STARTS]


def strained(fit: Fit, deviations: float = STRAINED) -> bool:
    """Whether a base number is bent by more than that many standard deviations of robot.toml."""
    return bool((np.abs(fit.point.base) > deviations).any())


def _polished(search: Search, fits: dict[str, Fit]) -> dict[str, Fit]:
    """The best refits once more with every column simulated anew, where base numbers are bent far.

    The columns of base numbers are those of the point before; a cause that relieves them changes them.
    """
    leads = {name: lead(search.problem, fit, search.fit) for name, fit in fits.items()}
    worth = sorted((name for name in fits if leads[name] > WORTH_POLISHING), key=lambda name: -leads[name])
    worth = [name for name in worth[:POLISHED] if leads[name] > CLOSE_ENOUGH * leads[worth[0]]]
    if not strained(search.fit) or len(worth) < 2:
        return fits
    none = np.zeros((0, search.problem.features.measured.size))
    refined = fit_many(search.problem, search.whitener, [fits[name].point for name in worth], none, 3)
    better = {name: fit for name, fit in zip(worth, refined, strict=True) if fit.cost <= fits[name].cost}
    return {**fits, **better}


def lead(problem: Problem, fit: Fit, other: Fit) -> float:
    """Log evidence of `fit` over `other`, of which no half second may count for more than a little.

    A wheel that breaks loose a moment too late is a large error of one moment, and any parameter that shifts
    that moment would seem to explain much. What a cause really does, it does again and again.
    """
    return fit.evidence - other.evidence - _excess(problem, fit.white, other.white)


def _excess(problem: Problem, white: Array, other: Array) -> float:
    """Log evidence of one whitened residual over another beyond what single events may give."""
    gains = 0.5 * (other**2 - white**2)
    starts = np.arange(0, len(gains), EVENT * problem.features.measured.shape[1])
    events = np.add.reduceat(gains, starts)
    return float((events - np.clip(events, -MOST_OF_EVENT, MOST_OF_EVENT)).sum())


@dataclass(frozen=True, slots=True)
class Probed:
    """A probe and the log evidence that it would add: all of it, and with no event counting for much."""

    name: str
    evidence: float
    lead: float


def best_probe(search: Search) -> Probed:
    """The probe that explains most of what is left, moment by moment; see `lead`."""
    found = [Probed("", 0.0, 0.0)]
    for gain, group, _ in screen(search):
        if group.name in search.problem.causes or group.name in search.unknown:
            continue
        if gain < LEAST_OF_PROBE or len(found) > PROBES_TRIED:
            break
        excess = _excess(search.problem, *_with_and_without(search, group))
        found.append(Probed(group.name, gain, gain - excess))
    most = max(each.lead for each in found)
    return max((each for each in found if each.lead >= NEARLY * most), key=lambda each: each.evidence)


def _with_and_without(search: Search, group: Group) -> tuple[Array, Array]:
    """Whitened residuals of the linear model with a group, and without it."""
    fit = search.fit
    own, target = fit.jacobian[fit.free], fit.target
    residuals = []
    for columns in (np.vstack([own, search.whitener(group.columns)]), own):
        mean, _, _ = Gram.of(columns.T, target).solve()
        residuals.append(target - mean @ columns)
    return residuals[0], residuals[1]
