"""Tests of the motor driver, real or simulated: its current from the battery, its deadband, and its state at
duty 0."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import costs_at, fit_point
from raccoon.diagnose.fit.problem import Point, Problem, transfer_point
from raccoon.diagnose.habits.alternatives import (
    MIN_LOG_EVIDENCE_LEAD,
    adopt_first_ahead,
    adopt_if_ahead,
    without_causes,
)
from raccoon.diagnose.habits.trials import HabitTrials, SearchAndHabits, start_afresh
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.alternative_sets import lead_over_search
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import resume_search, run_search, start_selection
from raccoon.diagnose.select.state import Search, linearise_search

DEADBAND = "actuation.deadband"
LOOKS_LIKE_DEADBAND = (DEADBAND, "friction.stiction", "friction.coulomb", "bemf.dead_zone")
"""Causes that are named if small commands do less than assumed."""
DEADBAND_SIZES = (0.02, 0.04, 0.06, 0.08, 0.1, 0.12, 0.15, 0.2)
"""Sizes of a deadband (duty) that are tried first."""
REFINEMENT_FACTORS = (0.8, 0.87, 0.93, 1.0, 1.07, 1.15, 1.25)
"""Factors on the best of them that are tried next."""
REFINEMENT_ROUNDS = 2
"""Number of times that a deadband is refined around the last best one."""
DEADBAND_SHAPES = ((False, False), (True, False), (False, True))
"""`Chain.threshold` and `Chain.cut`: whether commands beyond the deadband act in full, and whether they are
reduced by it; with neither they are stretched so that full power is full power."""


def try_whole_currents(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test a battery that carries all of each motor's current; the search under it if it leads.

    A simulation, or a sum of currents, may omit that a driver takes from the battery only in the share of the
    time in which it connects a motor: on fault-free robots this was reported as something unknown over the
    speed.
    """
    if "battery" not in search.problem.features.roles:
        return search, habits
    other = replace(habits, chain=replace(habits.chain, whole=not habits.chain.whole))
    return adopt_first_ahead(search, habits, [other], trials)


def try_other_stopping(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test motors that brake at duty 0 instead of coasting, or the opposite, if the rows do not state it; the
    search under it if it leads."""
    if not trials.stops_unrecorded:
        return search, habits
    other = replace(habits, brake=not habits.brake)
    return adopt_if_ahead(search, habits, trials, other, trials.problem_of(other), [search.fit.point])


def try_deadband_shapes(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test deadbands beyond which commands act in full, or reduced by it; the search under each that leads.
    One of 0.1 beyond which commands act in full was reported as 0.015, beside three frictions."""
    named = [name for name in search.fit.point.active if name.startswith(LOOKS_LIKE_DEADBAND)]
    if not (named or search.unknown) or DEADBAND not in search.problem.causes:
        return search, habits
    without_named = (without_causes(search.fit.point, named), search.problem.nominal())
    others = [
        replace(habits, chain=replace(habits.chain, threshold=threshold, cut=cut))
        for threshold, cut in DEADBAND_SHAPES
    ]
    for other in trials.untried(search, habits, (each for each in others if each != habits)):
        problem = trials.problem_of(other)
        fit = _fit_best_deadband(search, problem, without_named)
        if net_lead(search, fit, search.fit) < MIN_LOG_EVIDENCE_LEAD:
            trials.reject(search, habits, [other])
            continue
        start = start_afresh(problem)
        second = start_selection(linearise_search(problem, start.probes, fit.point, start.whitener))
        second = resume_search(second) if trials.run_search is run_search else second
        if lead_over_search(second, search) > MIN_LOG_EVIDENCE_LEAD:
            search, habits = second, other
    return search, habits


def _fit_best_deadband(search: Search, problem: Problem, points: Sequence[Point]) -> Fit:
    """The best fit with a deadband added to one of these points of the search. The response to a deadband
    without stretching is constant between two command levels, so a fit would stay at its start: sizes are
    chosen by their cost."""
    (deadband,) = problem.causes[DEADBAND].coordinates
    whitener = search.whitener

    def cheapest(points: Sequence[Point], sizes: Sequence[float]) -> Point:
        tried = [
            one.with_cause(DEADBAND, np.array([each / deadband.value(1.0)]))
            for each in sizes
            for one in points
        ]
        return tried[int(np.argmin(costs_at(problem, whitener, tried)))]

    starts = [transfer_point(each, search.problem, problem) for each in points]
    fit = fit_point(problem, whitener, cheapest(starts, DEADBAND_SIZES))
    for _ in range(REFINEMENT_ROUNDS):
        size = float(fit.point.active[DEADBAND][0]) * deadband.value(1.0)
        fit = fit_point(
            problem, whitener, cheapest([fit.point], [size * each for each in REFINEMENT_FACTORS])
        )
    return fit
