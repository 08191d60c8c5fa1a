"""Comparison of a search's result with fits and searches under other habits of the controller and the gears.

Habits are estimated before any cause is known, and the part of a cause that base numbers cannot absorb hides
the effect of a habit. So the result of a search is also fitted under other habits, and searched for again
under those with a lead.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.progress import report
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point, fit_with_frozen_columns
from raccoon.diagnose.fit.problem import Point, Problem, transfer_columns, transfer_point
from raccoon.diagnose.habits.chains import KNOWN_CHAINS
from raccoon.diagnose.habits.controller import (
    FAST_BATTERY_FILTERS_S,
    SLOW_BATTERY_FILTERS_S,
    battery_error,
    with_battery_filter,
)
from raccoon.diagnose.habits.trials import HabitTrials, RunSearch, SearchAndHabits, start_afresh, start_at
from raccoon.diagnose.hypotheses.base_coordinates import WheelSliding
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.alternative_sets import lead_over_search
from raccoon.diagnose.select.gates import CROWDED_CAUSES
from raccoon.diagnose.select.refits import SEVERAL_CAUSES
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import continue_selection, refine_selection, run_search, start_selection
from raccoon.diagnose.select.state import Search

Array = NDArray[np.float64]
LATENCY, BATTERY_RESISTANCE = "actuation.latency", "battery.internal_resistance"
STICTION = "friction.stiction"
MIN_LOG_EVIDENCE_LEAD = 10.0
"""Log evidence, gates included, by which another filter than the firmware's must lead in the end."""
ROUGH_STEPS = 8
"""Linearisations of a fit that determines which of several starts is the most likely."""
SEARCHING_AGAIN = "searching again with another controller or gear"
HOPELESS_DEFICIT, PREDICTED_GAIN_FACTOR = 150.0, 4.0
"""A fit is stopped if it is behind by so much log evidence even with this multiple of the gain that is
predicted for its next step; at most a hundred is accepted of a habit in the end."""


def fit_best_start(search: Search, problem: Problem, starts: Sequence[Point]) -> Fit:
    """The fit in another problem from the most likely of these starts, gates included.

    Several starts are first fitted roughly, with the base columns computed at the first of them; a single one
    starts with the columns that it has in the search. A fit that falls far behind is stopped.
    """
    whitener, carried_starts = (
        search.whitener,
        [transfer_point(each, search.problem, problem) for each in starts],
    )

    def is_hopeless(fit: Fit, predicted_gain: float) -> bool:
        gained = 0.5 * PREDICTED_GAIN_FACTOR * predicted_gain
        behind = fit.evidence + gained < search.fit.evidence - HOPELESS_DEFICIT
        return behind and net_lead(search, fit, search.fit) < -HOPELESS_DEFICIT

    start = carried_starts[0]
    if len(carried_starts) > 1:
        columns = evaluate_fit(problem, whitener, start).jacobian[: len(problem.base)]
        rough = fit_with_frozen_columns(problem, whitener, carried_starts, columns, ROUGH_STEPS, is_hopeless)
        start = max(rough, key=lambda each: net_lead(search, each, search.fit)).point
    elif (known := transfer_columns(search.fit.jacobian, search.problem, problem)) is not None:
        if list(start.active) != list(search.fit.point.active):
            known = known[: len(problem.base)]
        (first,) = fit_with_frozen_columns(problem, whitener, [start], known, ROUGH_STEPS, is_hopeless)
        if is_hopeless(first, 0.0):
            return first
        start = first.point
    return fit_point(problem, whitener, start, give_up=is_hopeless)


def log_evidence_lead(search: Search, problem: Problem, starts: Sequence[Point]) -> float:
    """Log evidence, gates included, by which the best of these starts leads a search."""
    return net_lead(search, fit_best_start(search, problem, starts), search.fit)


def search_again(search: Search, problem: Problem) -> Search | None:
    """The result of a whole search of another problem if it leads; else None."""
    second = _run_unless_behind(start_selection(start_afresh(problem)), search, 0.0, run_search)
    ahead = second is not None and lead_over_search(second, search) > MIN_LOG_EVIDENCE_LEAD
    return second if ahead else None


def adopt_if_ahead(
    search: Search,
    habits: Habits,
    trials: HabitTrials,
    other: Habits,
    problem: Problem,
    starts: Sequence[Point],
    min_fit_lead: float = MIN_LOG_EVIDENCE_LEAD,
    min_search_lead: float = MIN_LOG_EVIDENCE_LEAD,
    from_fit: bool = False,
) -> SearchAndHabits:
    """The search under other habits, whose problem is given, if they lead; else the unchanged search.

    They lead if the fit from one of these starts is ahead by `min_fit_lead` in log evidence, and then the
    result of a search by `min_search_lead`. If that search finds no cause, a lead of 0 suffices: that a wheel
    slides in another way than assumed is no less likely than a fault. from_fit: whether that search begins
    at this fit instead of robot.toml's numbers.
    """
    fit = fit_best_start(search, problem, starts)
    fit_lead = net_lead(search, fit, search.fit)
    if fit_lead < min_fit_lead:
        trials.reject(search, habits, [other])
        return search, habits
    if from_fit:
        first = start_selection(start_at(problem, fit.point, search.whitener))
    else:
        first = trials.start(other, problem)
    second = _run_unless_behind(first, search, min(min_search_lead, 0.0), trials.run_search)
    if second is None:
        trials.reject(search, habits, [other])
        return search, habits
    if found_nothing(second) and not found_nothing(search):
        min_search_lead = min(min_search_lead, 0.0)
    search_lead = lead_over_search(second, search)
    if second.fit.point.active.keys() == fit.point.active.keys():
        # A point that was fitted under smaller noise need not be the best fit under larger noise: one that
        # was ahead by 75 was 46 behind.
        search_lead = max(search_lead, fit_lead)
    return (second, other) if search_lead > min_search_lead else (search, habits)


def found_nothing(search: Search) -> bool:
    """Whether neither a cause nor an unknown effect is named."""
    return not (search.fit.point.active or search.unknown)


def _run_unless_behind(
    first: Search, search: Search, min_search_lead: float, run_search: RunSearch
) -> Search | None:
    """Continue a search that has begun as far as `run_search` would; None if it falls behind another
    search."""
    report(SEARCHING_AGAIN)
    if run_search is start_selection:
        return first
    if _ended_far_behind(first, search, min_search_lead):
        return None
    second = continue_selection(first)
    if _grown_crowded_and_behind(second, search):
        return None
    return refine_selection(second) if run_search is run_search else second


def _ended_far_behind(second: Search, search: Search, min_search_lead: float) -> bool:
    """Whether a search that has only begun ended with the causes that are named already, far from the lead
    that it needs: under the first habits, going on from these causes found nothing better."""
    named, named_by_second = search.fit.point.active, second.fit.point.active
    same = set(named) == set(named_by_second) and set(search.unknown) == set(second.unknown)
    few = len(named_by_second) < SEVERAL_CAUSES
    return same and few and lead_over_search(second, search) < min_search_lead - MIN_LOG_EVIDENCE_LEAD


def _grown_crowded_and_behind(second: Search, search: Search) -> bool:
    """Whether, beside many causes (CROWDED_CAUSES), another search is behind and has as many, or is far
    behind: habits that do not simplify the result are unlikely, and the rest of such a search takes
    longest."""
    if len(search.fit.point.active) < CROWDED_CAUSES:
        return False
    crowded = len(second.fit.point.active) >= CROWDED_CAUSES
    return lead_over_search(second, search) < (0.0 if crowded else -HOPELESS_DEFICIT)


def adopt_first_ahead(
    search: Search,
    habits: Habits,
    others: Sequence[Habits],
    trials: HabitTrials,
    min_fit_lead: float = MIN_LOG_EVIDENCE_LEAD,
) -> SearchAndHabits:
    """The search under the closest of other habits that leads, or the unchanged search; see
    `adopt_if_ahead`."""
    untried = trials.untried(search, habits, [each for each in others if each != habits])
    closer = _closer_habits(search, untried, trials)
    trials.reject(search, habits, (each for each in untried if each not in closer))
    starts = _starts_for_habits(search)
    for other, problem in closer.items():
        found, adopted = adopt_if_ahead(search, habits, trials, other, problem, starts, min_fit_lead)
        if adopted != habits:
            return found, adopted
    return search, habits


def try_friction_forms(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test other forms of sliding; the search under the first that leads, else the unchanged search.

    Rigid wheels, when the true ones were compliant, were reported as a robot with five times the resistance,
    a fifth of the inertia and little friction: the same drive, in which the compliance is stiffer.
    """
    forms = [each for each in WheelSliding if each not in (habits.sliding, WheelSliding.ELASTO_PLASTIC)]
    others = [replace(habits, sliding=each) for each in forms]
    search, habits = adopt_first_ahead(search, habits, others, trials)
    return _try_elasto_plastic_friction(search, habits, trials)


def _try_elasto_plastic_friction(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test elasto-plastic friction in the place of stiction; the search under it if it leads.

    Friction that holds completely until it slides breaks loose as if it stuck: on fault-free robots with soft
    tyres stiction of 0.04 to 0.08 N m was named, with a speed at its lower bound. Both together are further
    from the readings than each, so a fit begins without stiction too. The search begins at this fit: from
    robot.toml's compliance it would end at a tenth of the true one.
    """
    sticking = [each for each in search.fit.point.active if each.startswith(STICTION)]
    other = replace(habits, sliding=WheelSliding.ELASTO_PLASTIC)
    if not sticking or other == habits or not trials.untried(search, habits, [other]):
        return search, habits
    starts = [without_causes(search.fit.point, sticking), search.fit.point]
    return adopt_if_ahead(search, habits, trials, other, trials.problem_of(other), starts, from_fit=True)


def try_battery_filters(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test other filters of the battery's readings; the search under the best if it leads, else the unchanged
    search.

    RaccoonOS adds a filter of 0.1 s; without it a fault-free robot had a battery without resistance, and
    something unknown. The firmware's own filter is tested under other filters of the wheels' readings as
    well: a resistance 13 % high and a slip of 3 ms were named on a fault-free robot, 105 behind it.
    """
    if habits.knows_battery or "battery" not in search.problem.features.roles:
        return search, habits
    usual = (each.battery_time_constant for each in KNOWN_CHAINS)
    times = dict.fromkeys((*usual, *FAST_BATTERY_FILTERS_S, *SLOW_BATTERY_FILTERS_S))
    others = [each for each in (with_battery_filter(habits, time) for time in times) if each != habits]
    if len(trials.untried(search, habits, others)) < len(others):
        return search, habits
    closer = _closer_habits(search, others, trials)
    if not closer:
        trials.reject(search, habits, others)
        return search, habits
    starts = _starts_for_habits(search)
    likeliest = with_least_battery_error(search, closer, starts)
    return adopt_if_ahead(search, habits, trials, likeliest, closer[likeliest], starts)


def with_least_battery_error(
    search: Search, problems: Mapping[Habits, Problem], starts: Sequence[Point]
) -> Habits:
    """Of several habits, with their problems, those with the smallest error of the battery's readings."""
    carried_starts = {
        habits: [transfer_point(each, search.problem, problem) for each in starts]
        for habits, problem in problems.items()
    }
    return min(problems, key=lambda each: battery_error(problems[each], carried_starts[each]))


def without_causes(point: Point, names: Collection[str]) -> Point:
    """A point without these causes."""
    return replace(point, active={name: u for name, u in point.active.items() if name not in names})


def _closer_habits(search: Search, others: Sequence[Habits], trials: HabitTrials) -> dict[Habits, Problem]:
    """The other habits, with their problems, under which one of `_starts_for_habits` is closer to the
    readings; the closest first. Empty if nothing was found: known causes fit far worse under them than under
    their own habits."""
    if found_nothing(search):
        return {}
    present = _whitened_misfits(search, search.problem)
    problems = {each: trials.problem_of(each) for each in others}
    misfits = {habits: _whitened_misfits(search, problem) for habits, problem in problems.items()}
    closer = [each for each in others if (misfits[each] < present).any()]
    return {each: problems[each] for each in sorted(closer, key=lambda each: misfits[each].min())}


def _starts_for_habits(search: Search) -> list[Point]:
    """The fitted point, the same without each cause that most likely imitates another logger, and
    robot.toml."""
    point = search.fit.point
    without = [point.without_cause(each) for each in (LATENCY, BATTERY_RESISTANCE) if each in point.active]
    return [point, *without, search.problem.nominal()]


def _whitened_misfits(search: Search, problem: Problem) -> Array:
    """For each start in a problem, (starts,): the sum of the absolute whitened residuals."""
    starts = [transfer_point(each, search.problem, problem) for each in _starts_for_habits(search)]
    white = search.whitener(problem.features.measured - problem.predict(starts))
    return np.asarray(np.abs(white).sum(axis=-1), float)
