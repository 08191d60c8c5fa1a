"""What a motor driver, or who simulates one, takes from the battery and makes of small commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import costs_at, fit_point
from raccoon.diagnose.fit.problem import Point, Problem, carried
from raccoon.diagnose.habits.others import DOUBT, Onward, Under, first_ahead, started, without
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.alternative_sets import explains_more
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import begun, gone_on, whole
from raccoon.diagnose.select.state import Search, look_around

DEADBAND = "actuation.deadband"
LIKE_ONE = (DEADBAND, "friction.stiction", "friction.coulomb", "bemf.dead_zone")
"""What is named where small commands do less than was thought."""
SIZES = (0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2)
"""Duty, of deadbands that are tried first."""
AROUND = (0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25)
"""Parts of the best of them that are tried then."""
ROUNDS = 2
"""How often a deadband is looked for around the last best one."""
ENDS = ((False, False), (True, False), (False, True))
"""Whether commands beyond it do all that they say, and whether so much less; else all at full power."""


def with_whole_currents(
    search: Search, habits: Habits, under: Under, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search with a battery that carries all of each motor's current, where that explains more.

    Whoever simulates, or adds up currents, may not count what a driver takes from the battery by the share of
    the time in which it connects a motor: sound robots were then something unknown over the speed.
    """
    if "battery" not in search.problem.features.roles:
        return search, habits
    other = replace(habits, chain=replace(habits.chain, whole=not habits.chain.whole))
    return first_ahead(search, habits, [other], under, by)


def as_a_deadband_ends(
    search: Search, habits: Habits, under: Under, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search with a deadband beyond which commands do all that they say, or so much less, where that
    explains more: one of 0.1 that ends at once was one of 0.015, beside three frictions.
    """
    named = [name for name in search.fit.point.active if name.startswith(LIKE_ONE)]
    if not (named or search.unknown) or DEADBAND not in search.problem.causes:
        return search, habits
    point = search.fit.point
    less = (without(point, named), search.problem.nominal())
    others = [
        replace(habits, chain=replace(habits.chain, threshold=threshold, cut=cut)) for threshold, cut in ENDS
    ]
    for other in under.new(search, habits, (each for each in others if each != habits)):
        problem = under(other)
        fit = _likeliest(search, problem, less)
        if net_lead(search, fit, search.fit) < DOUBT:
            under.were_vain(search, habits, [other])
            continue
        start = started(problem)
        second = begun(look_around(problem, start.probes, fit.point, start.whitener))
        second = gone_on(second) if by is whole else second
        if explains_more(second, search) > DOUBT:
            search, habits = second, other
    return search, habits


def _likeliest(search: Search, problem: Problem, less: Sequence[Point]) -> Fit:
    """The best fit with a deadband beside one of these points. One that ends at once does the same between
    two commands, where a fit stays where it starts: so places are looked for by their cost."""
    (deadband,) = problem.causes[DEADBAND].coordinates
    whitener = search.whitener

    def cheapest(points: Sequence[Point], sizes: Sequence[float]) -> Point:
        tried = [
            one.with_cause(DEADBAND, np.array([each / deadband.value(1.0)]))
            for each in sizes
            for one in points
        ]
        return tried[int(np.argmin(costs_at(problem, whitener, tried)))]

    there = [carried(each, search.problem, problem) for each in less]
    fit = fit_point(problem, whitener, cheapest(there, SIZES))
    for _ in range(ROUNDS):
        size = float(fit.point.active[DEADBAND][0]) * deadband.value(1.0)
        fit = fit_point(problem, whitener, cheapest([fit.point], [size * each for each in AROUND]))
    return fit
