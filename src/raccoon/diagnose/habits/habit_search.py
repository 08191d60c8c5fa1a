"""The search of a drive under the habits of the controller, and the form of slip, that fit it best.

Habits are estimated before any cause is known, and the part of a cause that base numbers cannot absorb hides
the effect of a habit. So once causes are named, the result is fitted under the other habits too, and searched
for again under those with a lead: by the steps of `FIRST_STEPS`, `GROWN_STEPS` and `LAST_STEPS`, one after
the other.
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
    """A habit that is tested in another form. attempt: returns the search under it if it leads, else the
    unchanged search. known_firmware: whether it is also tested if the recording names the firmware, whose
    habits are known."""

    attempt: Callable[[Search, Habits, HabitTrials], SearchAndHabits]
    known_firmware: bool = False


FIRST_STEPS = (
    HabitStep(try_friction_forms, known_firmware=True),
    HabitStep(try_sampling_once_a_row),
    HabitStep(try_deadband_shapes),
    HabitStep(try_whole_currents),
    # The battery's filter before the wheels': if it is wrong, a wrong one of theirs may fit by chance.
    HabitStep(try_battery_filters, known_firmware=True),
    HabitStep(try_sensor_chains),
    # After other filters, which may be equivalent to a lag of some milliseconds.
    HabitStep(try_continuous_filter),
    HabitStep(try_pause_slowdown),
    # Again, under the estimated filter of the wheels' readings.
    HabitStep(try_friction_forms),
    HabitStep(try_battery_filters),
    HabitStep(try_lagging_readings),
)
"""Steps of a search that has only begun. Under wrong habits most of its time would be spent on sets of causes
that do not exist, so everything about wheels and filters that a whole search would find is determined before
it continues."""
GROWN_STEPS = (
    HabitStep(try_sampling_once_a_row),
    HabitStep(try_sensor_chains),
    HabitStep(try_friction_forms, known_firmware=True),
    HabitStep(try_lags_as_causes, known_firmware=True),
    HabitStep(try_pause_slowdown_beside_causes),
)
"""Steps of the first part of a search with several causes: they replace habits that were adopted while little
was known. The rest of the search takes as long again under each habit, and seldom changes its lead."""
LAST_STEPS = (
    HabitStep(try_sampling_once_a_row),
    HabitStep(try_sensor_chains),
    HabitStep(try_friction_forms, known_firmware=True),
    HabitStep(try_other_stopping, known_firmware=True),
    # Other loggers: with a slower filter of the battery, sums of currents, a gyro with a low-pass, or rows
    # with the command that has just ended.
    HabitStep(try_battery_filters, known_firmware=True),
    HabitStep(try_whole_currents),
    HabitStep(try_deadband_shapes),
    HabitStep(try_pause_slowdown),
    HabitStep(try_lagging_readings),
    HabitStep(try_commands_until_row),
    # Lags, after all habits that produce lags.
    HabitStep(try_lags_as_causes, known_firmware=True),
    HabitStep(try_immediate_slip, known_firmware=True),
    HabitStep(drop_lags_of_firmware, known_firmware=True),
    HabitStep(try_low_pass_for_gyro_lag, known_firmware=True),
)
"""Steps of a whole search."""


def search_with_habits(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None = None,
) -> tuple[Search, Habits, Log]:
    """The search, its habits, and the log with the changes of commands whose rows it lost.

    firmware: the controller's, whose habits are then not tested.

    Commands that changed in lost rows are placed again once causes are known: a current limit that is not yet
    known looks like a later change. If commands swing and one cause does not explain everything, the motion
    within swings is not compared: a loop that responds to a push before the wheels' readings do produced
    several causes on a robot without any.
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
        report("comparing averages over whole oscillations of the commands")
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
    """The search and its habits after each of these steps in turn."""
    for step in steps:
        if habits.firmware is None or step.known_firmware:
            search, habits = step.attempt(search, habits, trials)
    return search, habits


def _begin(habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """The beginning of a search from these habits (`start_selection`), followed by FIRST_STEPS."""
    search = start_selection(start_afresh(trials.problem_of(habits)))
    return _take(FIRST_STEPS, search, habits, trials.running(start_selection))


def _grow(search: Search, habits: Habits, trials: HabitTrials) -> SearchAndHabits:
    """The rest of the first part of a search that has begun, followed by GROWN_STEPS; unchanged if it ended
    with few causes."""
    if len(search.fit.point.active) < SEVERAL_CAUSES:
        return search, habits
    return _take(GROWN_STEPS, continue_selection(search), habits, trials.running(continue_selection))
