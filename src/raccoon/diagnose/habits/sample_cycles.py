"""Tests of how often the controller samples the wheels (once a row, once a cycle, continuously), and of
whether wheels are slower at that moment."""

from __future__ import annotations

from dataclasses import replace

from raccoon.core.progress import report
from raccoon.diagnose.habits.alternatives import (
    MIN_LOG_EVIDENCE_LEAD,
    SEARCHING_AGAIN,
    adopt_first_ahead,
    fit_best_start,
)
from raccoon.diagnose.habits.chains import CONTINUOUS_CYCLE_S, has_back_emf, with_pause_slowdown_toggled
from raccoon.diagnose.habits.controller import with_sample_cycle
from raccoon.diagnose.habits.lags import look_from
from raccoon.diagnose.habits.trials import HabitTrials, SearchAndHabits
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import continue_selection
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.chain import Chain


def try_sampling_once_a_row(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test motors that are sampled once a row instead of once a cycle, or the opposite; the search under it
    if it leads.

    A filter that runs once a row of 20 ms is 8 ms earlier than one of the same time constant that runs every
    5 ms: on a fault-free robot it was reported as a filter with two thirds of the time constant.
    """
    by_row = habits.chain.cycle == trials.row_cycle
    cycle = Chain().cycle if by_row else trials.row_cycle
    return adopt_first_ahead(search, habits, [with_sample_cycle(habits, cycle)], trials)


def try_continuous_filter(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test a filter of the wheels' readings in continuous time; the search under it if it leads.

    On each of ten fault-free robots it was reported as a latency of 2 ms. It has no parameter, so it needs no
    gate.
    """
    if habits.chain.median or habits.chain.free_running:
        return search, habits
    other = with_sample_cycle(habits, CONTINUOUS_CYCLE_S)
    return adopt_first_ahead(search, habits, [other], trials, min_fit_lead=0.0)


def try_pause_slowdown(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test wheels that are slower when they are sampled than on average, or the opposite; the search under it
    if it leads.

    A motor that coasts for half a millisecond before each sample loses a count or two until then, in either
    direction: on most fault-free robots with such pauses this was reported as a deadband of 0.002 to 0.004
    with a probability of 1, or as the scale of a reading. A simulation by the mean of the torque does not
    have it.
    """
    other = _with_pause_slowdown_toggled(search, habits)
    if other is None:
        return search, habits
    return adopt_first_ahead(search, habits, [other], trials, min_fit_lead=0.0)


def try_pause_slowdown_beside_causes(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """The same beside several causes, which are kept: a pause changes a reading by a count or two."""
    other = _with_pause_slowdown_toggled(search, habits)
    if other is None or not trials.untried(search, habits, [other]):
        return search, habits
    problem = trials.problem_of(other)
    fit = fit_best_start(search, problem, [search.fit.point])
    lead = net_lead(search, fit, search.fit)
    if lead < MIN_LOG_EVIDENCE_LEAD:
        trials.reject(search, habits, [other] if lead < 0.0 else [])
        return search, habits
    report(SEARCHING_AGAIN)
    return continue_selection(look_from(search, problem, fit.point)), other


def _with_pause_slowdown_toggled(search: Search, habits: Habits) -> Habits | None:
    """Habits with wheels that pauses slow down, or without that if they have it; None if there are no
    pauses."""
    chain = with_pause_slowdown_toggled(habits.chain)
    if chain is None or not has_back_emf(search.problem.features.roles):
        return None
    return replace(habits, chain=chain)
