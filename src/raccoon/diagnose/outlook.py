"""What can be seen from one working point: fit, noise, columns in every direction, and who is worth a
refit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.evidence import Gram, cross_validated
from raccoon.diagnose.fit import Fit, fit_many, fit_point, unbound
from raccoon.diagnose.linear import BLOCKS, Group, Linear, Table, linearise, tabulate, whitener_for
from raccoon.diagnose.problem import Point, Problem, Whitener

Array = NDArray[np.float64]

REFITS = 5
PLAIN_REFITS = 3


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
    fit = fit_point(problem, whitener, problem.nominal(), 2)
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
    table = tabulate(linear, extra, whitener, len(problem.base))
    plain = tabulate(linear, extra, whitener.without_slow(), len(problem.base))
    white = whitener(np.concatenate([linear.residual[None], linear.own]))
    vector = point.vector()
    cost = float(white[0] @ white[0] + vector @ vector)
    fit = Fit(point, white[0], white[1:], cost, unbound(problem, point))
    return Search(problem, probes, fit, whitener, linear, table, plain, unknown=dict(unknown or {}))


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
    first = float(np.clip(mean[0], 0.2 * group.start[0] if low == 0.0 else -3.0, 3.0))
    return np.array([first, *group.start[1:]])


def refit_candidates(search: Search) -> list[tuple[str, Fit]]:
    """True refits of the most promising causes, best evidence first, one a cause."""
    chosen = candidates(search)
    if not chosen:
        return []
    point = search.fit.point
    starts = [point.with_cause(group.name, first_guess(search, group, mean)) for _, group, mean in chosen]
    fits = fit_many(search.problem, search.whitener, starts, search.fit.jacobian, 4)
    best: dict[str, Fit] = {}
    for (_, group, _), fit in zip(chosen, fits, strict=True):
        if group.name not in best or fit.evidence > best[group.name].evidence:
            best[group.name] = fit
    return sorted(best.items(), key=lambda each: -each[1].evidence)


def best_probe(search: Search) -> tuple[str, float]:
    """The probe that explains most of what is left, and by how much log evidence."""
    for gain, group, _ in screen(search):
        if group.name not in search.problem.causes and group.name not in search.unknown:
            return group.name, gain
    return "", 0.0
