"""Tests of other explanations of named lags: a gyro's low-pass, a controller's own clock, another lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.progress import report
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.alternatives import (
    LATENCY,
    MIN_LOG_EVIDENCE_LEAD,
    fit_best_start,
    with_least_battery_error,
    without_causes,
)
from raccoon.diagnose.habits.chains import (
    FREE_RUNNING,
    USUAL_CHAINS,
    with_driver_of,
    without_unneeded_pause,
)
from raccoon.diagnose.habits.controller import (
    FAST_BATTERY_FILTERS_S,
    SLOW_BATTERY_FILTERS_S,
    with_battery_filter,
)
from raccoon.diagnose.habits.trials import HabitTrials, SearchAndHabits
from raccoon.diagnose.hypotheses.base_coordinates import LOW_PASS
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.alternative_sets import lead_over_search
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.refits import GYRO_LOW_PASS, equal_lag
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import resume_search, run_search
from raccoon.diagnose.select.set_scoring import overlaps_none
from raccoon.diagnose.select.state import Rival, Search, linearise_search
from raccoon.diagnose.unknown.probes import make_probe_function
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

GYRO_LATENCY, SLIP = "imu.latency", "drive.wheel_slip"
GYRO_LAGS = (GYRO_LATENCY, SLIP)
"""Causes that delay the gyro alone."""
MIN_LOW_PASS_LEAD = 3.0
"""Log evidence, gates included, by which a gyro's low-pass must lead. Wheels that slip by its time are
equivalent."""
MAX_FEW_CAUSES = 2
"""Number of other causes up to which that applies. The stock firmware's chip has a low-pass, so for a robot
with one or two faults it usually is the lag; for one with many a small slip may well be one more."""
CLEAR_LOG_EVIDENCE_LEAD = 15.0
"""Log evidence by which a low-pass must lead beside more causes. It has two numbers, slip one: beside three
causes and more it led by 1 to 4, once by 11, if wheels slipped, and by 3 to 24 if the chip had a low-pass. It
was 14 ahead of a fit of slip that had not converged, which then led by 1."""


def try_lagging_readings(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test a gyro with a low-pass, and that with a controller's own clock, if lags are named; the search
    under them if it leads.

    The clock has priority: it is how a Wombat works, and need not lead before a search under it, nor by more
    than the gates of the lags that it explains. The same applies to the low-pass if lags are all that was
    found, and beside few causes once the search was whole. A robot with more faults may slip as well, and a
    slip and a late gyro together look like a gyro's low-pass: then the low-pass must explain more without
    gates, or it becomes a rival of the lag. A search that has only begun does not know how many faults there
    are.
    """
    point, lags = search.fit.point, _named_lags(search)
    if not lags or trials.lags_of_robot or "gyro" not in search.problem.features.roles:
        return search, habits
    smooth = replace(habits, low_pass=True)
    free = _with_free_running_clock(search, smooth, trials)
    starts = starts_with_low_pass(search, _named_gyro_lags(search), lags)
    others = len(point.active.keys() - lags)
    completely = trials.run_search is run_search
    alone = others == 0 or (others <= MAX_FEW_CAUSES and completely and not search.unknown)
    min_leads = {smooth: MIN_LOW_PASS_LEAD if alone else MIN_LOG_EVIDENCE_LEAD, free: -MIN_LOG_EVIDENCE_LEAD}
    ahead = []
    for other in trials.untried(search, habits, (each for each in min_leads if each != habits)):
        problem = trials.problem_of(other)
        fit = fit_best_start(search, problem, starts)
        by_gates = alone or other is free
        fit_lead = (
            net_lead(search, fit, search.fit) if by_gates else log_evidence_lead(problem, fit, search.fit)
        )
        if fit_lead >= min_leads[other]:
            ahead.append((other, problem, fit.point))
        elif completely:
            trials.reject(search, habits, [other])
    for other, problem, start in reversed(ahead):
        report("continuing with another gyro or clock")
        second = trials.run_search(
            linearise_search(problem, make_probe_function(problem), start, search.whitener)
        )
        if lead_over_search(second, search) > -MIN_LOW_PASS_LEAD:
            return second, other
    return search, habits


def try_lags_as_causes(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test the lags of the catalogue instead of a gyro's low-pass and a controller's own clock. They are
    adopted if more causes are named than when these habits were adopted, if the lags explain about as much,
    and if one of the gyro reaches its gate.

    Instead of a clock they must explain more: on robots with one they are behind by up to 8, and lead by 30
    to 145 if there is none; by 7 if samples at any moment are the firmware's. Habits that were replaced in
    this way are not tested again.
    """
    active, clock = search.fit.point.active.keys(), habits.chain.free_running
    # A gyro's low-pass delays no command, a clock does.
    others = active - (_named_lags(search) if clock else _named_gyro_lags(search))
    if not (habits.low_pass or clock) or habits.wombat or len(others) <= MAX_FEW_CAUSES:
        return search, habits
    other = _without_clock_and_low_pass(habits)
    max_lead = CLEAR_LOG_EVIDENCE_LEAD
    if clock:
        max_lead = -MIN_LOW_PASS_LEAD if habits.fits_sample_ages else -MIN_LOG_EVIDENCE_LEAD
    problem = trials.problem_of(other)  # also if rejected: without lags it is far behind a clock
    fit = fit_best_start(search, problem, _starts_with_lags_as_causes(search, problem))
    settled = fit_point(search.problem, search.whitener, search.fit)  # converged, as the other fit is
    if log_evidence_lead(problem, settled, fit) < max_lead:
        report("continuing with lags of the robot instead of its gyro's filter or its controller's clock")
        second = look_from(search, problem, fit.point)
        second = resume_search(second) if trials.run_search is run_search else trials.run_search(second)
        if _named_gyro_lags(second) or clock:
            trials.lags_of_robot.add(habits)
            return second, other
    return search, habits


def _without_clock_and_low_pass(habits: Habits) -> Habits:
    """Habits of a controller in step with its rows, and a gyro without a low-pass, with the same battery
    filter."""
    other = replace(habits, low_pass=False)
    if not habits.chain.free_running:
        return other
    usual = replace(Chain.firmware(), coast_share=habits.chain.coast_share)
    other = replace(other, chain=with_driver_of(usual, habits.chain), fits_sample_ages=False)
    return with_battery_filter(other, habits.chain.battery_time_constant)


def _starts_with_lags_as_causes(search: Search, problem: Problem) -> list[Point]:
    """The fitted point, in a problem with fewer free numbers, with the gyro's whole lag as a slip, a late
    gyro, or half of each; each with and without the commands' lag as a latency. A slip of one wheel beside a
    gyro's low-pass is usually half of both."""
    point, causes = search.fit.point, problem.causes
    settings = search.problem.settings(point)
    gyro_lag = settings[GYRO_LOW_PASS, None, "time_constant"] + settings[GYRO_LATENCY, None, "seconds"]
    gyro_lag += 0.5 * sum(settings[SLIP, side, "time"] for side in SIDES)
    without_gyro_lags = without_causes(point, _named_gyro_lags(search))

    def as_cause(name: str, seconds: float) -> dict[str, Array]:
        """A lag of so many seconds, if the catalogue has it."""
        return {name: np.array([seconds / causes[name].coordinates[0].value(1.0)])} if name in causes else {}

    gyro_lags = [as_cause(each, gyro_lag) for each in GYRO_LAGS]
    gyro_lags.append({name: 0.5 * u for each in gyro_lags for name, u in each.items()})
    latency = as_cause(LATENCY, settings[LATENCY, None, "seconds"])
    return [
        replace(without_gyro_lags, active={**without_gyro_lags.active, **late, **lag})
        for lag in gyro_lags
        for late in ({}, latency)
    ]


def starts_with_low_pass(search: Search, gyro_lags: Sequence[str], lags: Sequence[str]) -> list[Point]:
    """The fitted point, and the same with its lags shortened by the delay of a gyro's low-pass, or without
    them. Each of the gyro's lags is also removed alone: a chip slightly slower than usual explains all of one
    beside another, and the rest must not cost a gate."""
    point = search.fit.point
    return [
        point,
        *(_with_shorter_lag(search, each, LOW_PASS) for each in gyro_lags),
        *(point.without_cause(each) for each in gyro_lags),
        *(without_causes(point, names) for names in (gyro_lags, lags)),
    ]


def _with_free_running_clock(search: Search, habits: Habits, trials: HabitTrials) -> Habits:
    """These habits for a controller with its own clock, with the best filter of the battery's readings; a
    detected slow one is kept. A controller that reads no back-EMF need not pause for it."""
    time = habits.chain.battery_time_constant
    free = with_driver_of(FREE_RUNNING, habits.chain)
    chain = without_unneeded_pause(free, habits.chain, search.problem.features.roles)
    times = {time}
    if time not in SLOW_BATTERY_FILTERS_S:
        times = {*FAST_BATTERY_FILTERS_S, *(each.battery_time_constant for each in USUAL_CHAINS)}
    others = [with_battery_filter(replace(habits, chain=chain), each) for each in sorted(times)]
    if len(others) == 1 or "battery" not in search.problem.features.roles:
        return others[0]
    problems = {each: trials.problem_of(each) for each in others}
    return with_least_battery_error(search, problems, [search.fit.point])


def drop_lags_of_firmware(search: Search, habits: Habits, _: HabitTrials) -> SearchAndHabits:
    """The search without a lag that is no larger than a known firmware may have.

    A fit of the base number stops on a step of the latency's staircase: with 3.4 ms in it a fault-free robot
    had 0.8 ms more as a cause with 42 of log evidence, and none with all 4.2 ms in it.
    """
    for name in _named_lags(search) if habits.wombat else ():
        start = _with_lag_in_base(search, name)
        if start is None:
            continue
        fit = fit_point(search.problem, search.whitener, start)
        if log_evidence_lead(search.problem, search.fit, fit) < gate(name):
            search.rejections[name] = "not later than the firmware itself may be"
            second = look_from(search, search.problem, fit.point)
            second.rejections.update(search.rejections)
            return resume_search(second), habits
    return search, habits


def _with_lag_in_base(search: Search, name: str) -> Point | None:
    """The fitted point with a lag added to the base number of the same setting; None if there is none or the
    result is out of its bounds."""
    point, (coordinate,) = search.fit.point, search.problem.causes[name].coordinates
    for index, each in enumerate(search.problem.base):
        if each.settings == coordinate.settings:
            base = point.base.copy()
            base[index] += coordinate.value(float(point.active[name][0])) / each.value(1.0)
            if each.low <= base[index] <= each.high:
                return replace(point.without_cause(name), base=base)
    return None


def try_low_pass_for_gyro_lag(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """The search, with the gyro's low-pass recorded as a rival of each lag of the gyro; or the search with it
    if it clearly leads the named lag."""
    gyro_lags = _named_gyro_lags(search)
    lags = [each for each in gyro_lags if each in GYRO_LAGS]  # not those of one wheel
    if habits.low_pass or not lags or "gyro" not in search.problem.features.roles:
        return search, habits
    few = len(search.fit.point.active.keys() - gyro_lags) <= MAX_FEW_CAUSES
    smooth = replace(habits, low_pass=True)
    problem = trials.problem_of(smooth)
    problem = replace(problem, neutral={**problem.neutral, **search.problem.neutral})
    settled = fit_point(search.problem, search.whitener, search.fit)
    for name in lags:
        fit = fit_best_start(search, problem, [search.fit.point.without_cause(name)])
        deficit = log_evidence_lead(problem, settled, fit)
        clear = -(MIN_LOG_EVIDENCE_LEAD if few else CLEAR_LOG_EVIDENCE_LEAD)
        if deficit < clear and habits.firmware is None:
            report("continuing with a gyro that smooths")
            second = resume_search(look_from(search, problem, fit.point))
            if lead_over_search(second, search) > -MIN_LOW_PASS_LEAD:
                return second, smooth
        note_rival(search, name, GYRO_LOW_PASS, deficit)
    return search, habits


def note_rival(search: Search, name: str, other: str, deficit: float) -> None:
    """Record another cause as a rival of a cause, by `deficit` of log evidence behind it."""
    known = search.rivals.get(name, [])
    same = [Rival(other, deficit), *(each for each in known if each.name == other)]
    best = min(same, key=lambda each: each.lead)
    search.rivals[name] = sorted(
        [*(each for each in known if each.name != other), best], key=lambda each: each.lead
    )


def look_from(search: Search, problem: Problem, point: Point) -> Search:
    """A search at a point of this problem, ready to continue; unknown probes are kept."""
    return linearise_search(problem, make_probe_function(problem), point, search.whitener, search.unknown)


def _named_lags(search: Search) -> list[str]:
    """The named causes that are lags."""
    return [name for name in search.fit.point.active if name.startswith((LATENCY, *GYRO_LAGS))]


def _named_gyro_lags(search: Search) -> list[str]:
    """The named causes that delay the gyro alone."""
    return [name for name in search.fit.point.active if name.startswith(GYRO_LAGS)]


def starts_with_other_lags(search: Search, name: str, others: Sequence[str]) -> list[Point]:
    """The fitted point with each of these other lags in place of a named one; empty if that is not named."""
    point = search.fit.point
    if name not in point.active:
        return []
    without_lag = point.without_cause(name)
    possible = [
        each for each in others if each in search.problem.causes and overlaps_none(each, without_lag.active)
    ]
    return [without_lag.with_cause(each, equal_lag(search, name, each)) for each in possible]


def _with_shorter_lag(search: Search, name: str, seconds: float) -> Point:
    """The fitted point with a lag shortened by `seconds`, or without it if nothing is left."""
    point, (coordinate,) = search.fit.point, search.problem.causes[name].coordinates
    left = point.active[name] - seconds / coordinate.value(1.0)
    return point.with_cause(name, left) if left[0] > 0.0 else point.without_cause(name)
