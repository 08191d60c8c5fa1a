"""Tests of other sensor chains: another filter of the wheels' readings, or commands that are logged late."""

from __future__ import annotations

from dataclasses import replace

from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.habits.alternatives import (
    LATENCY,
    MIN_LOG_EVIDENCE_LEAD,
    adopt_first_ahead,
    adopt_if_ahead,
    found_nothing,
    without_causes,
)
from raccoon.diagnose.habits.chains import (
    MEDIAN_AT_CYCLE_END,
    PAUSING_AT_CYCLE_END,
    alternative_chains,
    has_back_emf,
    known_chain_of,
    pauses_at_cycle_end,
    sample_cycle_of,
    with_driver_of,
    without_unneeded_pause,
)
from raccoon.diagnose.habits.lags import GYRO_LATENCY, SLIP, starts_with_other_lags
from raccoon.diagnose.habits.trials import HabitTrials, SearchAndHabits
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.refits import SHARED_SCALE_CAUSES
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.symmetry import exact_twins
from raccoon.sim.effects.chain import Chain

LOOKS_LIKE_FILTER = (LATENCY, "bemf.filter_lag")
MAX_FIRMWARE_DEFICIT = 100.0
"""Log evidence by which the firmware's chain may be behind, with the causes that were found under another
one, and still be searched under."""


def try_sensor_chains(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test other chains of the wheels' readings; the search under each one that leads, else the unchanged
    search.

    * If nothing is named, none is tested: the response of feedback loops to a floor's disturbances is
      explained slightly better by many a filter with another time constant.
    * The firmware's chain may be the right one if a latency or a lag imitates it, or, for its pause, a
      resistance or a number on its scale. It need not lead before a search under it.
    * A late gyro may really be late commands under a filter whose delay is shorter by as much, and a latency
      of one sample a late gyro under a median.
    * Motors that coast while they are sampled are the same drive as a resistance that is lower by their share
      of the time, so that chain is adopted if it is as likely. With encoders the firmware's chain differs in
      that only.
    """
    if found_nothing(search):
        return search, habits
    roles = search.problem.features.roles
    back_emf = has_back_emf(roles)  # with encoders only the firmware's chain is tested, for its pause
    chains = (without_unneeded_pause(each, habits.chain, roles) for each in alternative_chains(habits.chain))
    chains = (each for each in chains if each != habits.chain)
    for other in trials.untried(search, habits, (replace(habits, chain=each) for each in chains)):
        pausing = pauses_at_cycle_end(other.chain)
        if pausing and not (back_emf and known_chain_of(habits.chain) == MEDIAN_AT_CYCLE_END):
            continue
        named = search.fit.point.active
        firmware = known_chain_of(other.chain) == Chain.firmware()
        like = LOOKS_LIKE_FILTER if habits.chain.coast_share else (*LOOKS_LIKE_FILTER, *SHARED_SCALE_CAUSES)
        imitated = firmware and any(name.startswith(like) for name in named)
        starts = [
            search.fit.point,
            *starts_with_other_lags(search, GYRO_LATENCY, (LATENCY,)),
            *starts_with_other_lags(search, LATENCY, (GYRO_LATENCY, SLIP)),
        ]
        min_fit_lead = -MAX_FIRMWARE_DEFICIT if imitated else MIN_LOG_EVIDENCE_LEAD
        min_search_lead = -MIN_LOG_EVIDENCE_LEAD if firmware else MIN_LOG_EVIDENCE_LEAD
        if pausing or (firmware and not back_emf):
            starts += _starts_with_pause(search)
            min_fit_lead = min_search_lead = 0.0
        problem = trials.problem_of(other)
        search, habits = adopt_if_ahead(
            search, habits, trials, other, problem, starts, min_fit_lead, min_search_lead
        )
    return _try_median_with_low_pass(search, habits, trials) if back_emf else (search, habits)


def _starts_with_pause(search: Search) -> list[Point]:
    """Starts of fits under a chain with pauses: the fitted point and its exact twins, each without the causes
    that a pause imitates.

    The twins are needed since without the pause, the scale that it changes decides which of them agrees best
    with robot.toml: of a gyro that read 5 % too much, K_E of both motors then was the likeliest.
    """
    point = search.fit.point
    drives = [point, *(twin for _, twin in exact_twins(search.problem, point))]
    return [
        without_causes(each, [name for name in each.active if name.startswith(SHARED_SCALE_CAUSES)])
        for each in drives
    ]


def _try_median_with_low_pass(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test a median and a gyro with a low-pass together if late commands were named without both; adopted if
    they are as likely. Each alone leaves the other half of the delay unexplained."""
    if habits.chain.median or habits.low_pass or LATENCY not in search.fit.point.active:
        return search, habits
    point, (latency,) = search.fit.point, search.problem.causes[LATENCY].coordinates
    own = habits.chain
    cycle = sample_cycle_of(own)
    shorter = point.active[LATENCY] - cycle / latency.value(1.0)
    less_late = [point.without_cause(LATENCY)]
    less_late += [point.with_cause(LATENCY, shorter)] if shorter[0] > 0.0 else []
    scaled = [name for name in point.active if name.startswith(SHARED_SCALE_CAUSES)]
    starts = [start for each in less_late for start in (each, without_causes(each, scaled))]
    chains = (
        replace(with_driver_of(each, own), battery_time_constant=own.battery_time_constant, cycle=cycle)
        for each in (PAUSING_AT_CYCLE_END, MEDIAN_AT_CYCLE_END)
    )
    others = [replace(habits, chain=each, low_pass=True) for each in chains]
    for other in trials.untried(search, habits, others):
        problem = trials.problem_of(other)
        found, adopted = adopt_if_ahead(search, habits, trials, other, problem, starts, 0.0, 0.0)
        if adopted == other:
            return found, adopted
    return search, habits


def try_commands_until_row(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """Test a log whose rows hold the command that was in force until then; the search under it if it leads.

    Such commands are in the row after theirs and seem early, which nothing in the catalogue is; they were
    reported as a filter without a median, a latency of 3 ms and a gear that loses torque.
    """
    firmware = with_driver_of(Chain.firmware(), habits.chain)
    # A plain filter that imitated it may have absorbed the battery's filter.
    seen = replace(firmware, battery_time_constant=habits.chain.battery_time_constant)
    chains = dict.fromkeys((habits.chain, seen, firmware))
    others = [replace(habits, chain=chain, commands_precede_rows=True) for chain in chains]
    return adopt_first_ahead(search, habits, others, trials)
