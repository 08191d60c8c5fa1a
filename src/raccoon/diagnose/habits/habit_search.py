"""The search of a drive under the habits of the controller, and the form of slip, that fit it best.

Habits are found out before any cause is known, and what base numbers cannot do for a cause hides what a habit
does. So once causes are named what was found is fitted under the others too, and searched for again where one
of them leads: by the steps of `FIRST_STEPS`, `GROWN_STEPS` and `LAST_STEPS`, one after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.core.progress import report
from raccoon.diagnose.drives.excitation import swing_period
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.habits.alternatives import try_battery_filters, try_friction_forms
from raccoon.diagnose.habits.chain_trials import try_commands_until_row, try_sensor_chains
from raccoon.diagnose.habits.command_times import place_commands
from raccoon.diagnose.habits.controller import find_habits, sample_cycle_from_rows
from raccoon.diagnose.habits.lags import (
    drop_lags_of_firmware,
    try_lagging_readings,
    try_lags_as_causes,
    try_low_pass_for_gyro_lag,
)
from raccoon.diagnose.habits.motor_driver import (
    try_deadband_shapes,
    try_other_stopping,
    try_whole_currents,
)
from raccoon.diagnose.habits.problems import drive_problem, with_lost_changes
from raccoon.diagnose.habits.sample_cycles import (
    try_continuous_filter,
    try_pause_slowdown,
    try_pause_slowdown_beside_causes,
    try_sampling_once_a_row,
)
from raccoon.diagnose.habits.slip_forms import try_immediate_slip
from raccoon.diagnose.habits.trials import HabitTrials, SearchAndHabits, start_afresh
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.refits import SEVERAL_CAUSES
from raccoon.diagnose.select.search import continue_selection, refine_selection, run_search, start_selection
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.parameters import Parameters


@dataclass(frozen=True, slots=True)
class HabitStep:
    """One habit that is tried in another form. attempt: gives the search under it where that leads, else the
    search as it is. known_firmware: whether it is tried as well where the recording names the firmware, whose
    habits are known."""

    attempt: Callable[[Search, Habits, HabitTrials], SearchAndHabits]
    known_firmware: bool = False


FIRST_STEPS = (
    HabitStep(try_friction_forms, known_firmware=True),
    HabitStep(try_sampling_once_a_row),
    HabitStep(try_deadband_shapes),
    HabitStep(try_whole_currents),
    # The battery's filter before the wheels': where it is wrong, another of theirs may suit by chance.
    HabitStep(try_battery_filters, known_firmware=True),
    HabitStep(try_sensor_chains),
    # After other filters, which a lag of some milliseconds may be as well.
    HabitStep(try_continuous_filter),
    HabitStep(try_pause_slowdown),
    # Again, under the filter of the wheels' readings that was found.
    HabitStep(try_friction_forms),
    HabitStep(try_battery_filters),
    HabitStep(try_lagging_readings),
)
"""Of a search that has only begun. Under wrong habits most of its time goes to sets of causes that are not
there, so what a whole search would find out about wheels and filters is found out before it goes on."""
GROWN_STEPS = (
    HabitStep(try_sensor_chains),
    HabitStep(try_friction_forms, known_firmware=True),
    HabitStep(try_lags_as_causes, known_firmware=True),
    HabitStep(try_pause_slowdown_beside_causes),
)
"""Of the first part of a search with several causes: habits that replace those which were taken while little
was known. The rest takes as long again under each, and seldom changes by which it leads."""
LAST_STEPS = (
    HabitStep(try_sensor_chains),
    HabitStep(try_friction_forms, known_firmware=True),
    HabitStep(try_other_stopping, known_firmware=True),
    # What else writes logs: something that follows the battery more slowly, adds up currents by itself, has a
    # gyro that smooths, or writes what it has just done.
    HabitStep(try_battery_filters, known_firmware=True),
    HabitStep(try_whole_currents),
    HabitStep(try_deadband_shapes),
    HabitStep(try_pause_slowdown),
    HabitStep(try_lagging_readings),
    HabitStep(try_commands_until_row),
    # Of lags, once all that makes them by habit has been tried.
    HabitStep(try_lags_as_causes, known_firmware=True),
    HabitStep(try_immediate_slip, known_firmware=True),
    HabitStep(drop_lags_of_firmware, known_firmware=True),
    HabitStep(try_low_pass_for_gyro_lag, known_firmware=True),
)
"""Of a whole search."""


def search_with_habits(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None = None,
) -> tuple[Search, Habits, Log]:
    """The search, the habits that it is under, and the log with the changes of commands whose rows it lost.

    firmware: the controller's, whose habits are not tried then.

    Commands that changed in lost rows are placed again once causes are known: a limit of the current that is
    not known yet looks like a later change. Where commands swing and one cause is not all, what is in the
    swings is not compared: a loop that hears of a push before the wheels' readings do has had several causes
    of a robot without any.
    """
    report("finding out what the controller does with its samples")
    log, fit = (log, None) if firmware else place_commands(log, robot, causes, model)
    restored, first = find_habits(log, robot, causes, model, firmware, fit)

    def trials_of(log: Log) -> HabitTrials:
        return HabitTrials(
            lambda habits: drive_problem(log, robot, causes, habits, model),
            row_cycle=sample_cycle_from_rows(log),
            stops_unrecorded=log.brake is None and not log.duty.all(),
        )

    trials = trials_of(restored)
    search, habits = _begin(first, trials)
    if len(search.named) > 1 and (seconds := swing_period(log)):
        report("comparing over whole swings of the commands")
        search, habits = _begin(replace(first, swing_period=seconds), trials)
    search, habits = _grow(search, habits, trials)
    search = refine_selection(search)
    better = with_lost_changes(log, robot, causes, habits, model, search.fit.point)
    if not np.array_equal(better.time, restored.time):
        restored, trials = better, trials_of(better)
        search = run_search(start_afresh(trials.problem_of(habits)))
    search, habits = _take(LAST_STEPS, search, habits, trials)
    return search, habits, restored


def _take(steps: Sequence[HabitStep], search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """The search, and the habits that it is under, after each of these steps in turn."""
    for step in steps:
        if habits.firmware is None or step.known_firmware:
            search, habits = step.attempt(search, habits, trials)
    return search, habits


def _begin(habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """The beginning of a search from these habits on."""
    search = start_selection(start_afresh(trials.problem_of(habits)))
    return _take(FIRST_STEPS, search, habits, trials.running(start_selection))


def _grow(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """The first part of a search that has begun; of one with few causes that is its beginning."""
    if len(search.fit.point.active) < SEVERAL_CAUSES:
        return search, habits
    return _take(GROWN_STEPS, continue_selection(search), habits, trials.running(continue_selection))
