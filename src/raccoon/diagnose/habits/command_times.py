"""Commands that changed within the row before theirs, as in the rows of a logger beside the driving program.

Such a logger sleeps for 8 or 10 ms and then writes the last command and the last readings, while the program
gives commands at any time. Each has then begun up to a row before its own; with rows of 8 ms that looks like
friction, inertia and a wheel's slip. The wheels show when: the time of a jump that changes a speed by 1000
counts in 50 ms is known to a tenth of a row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.features import SETTLING_S
from raccoon.diagnose.drives.log import WHEELS, Log
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.controller import fit_habits, sample_cycle_from_rows
from raccoon.diagnose.habits.habit_fits import HabitFit
from raccoon.diagnose.habits.lost_commands import RESPONSE_S, in_bins_like
from raccoon.diagnose.habits.problems import free_problem_of
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

MIN_DUTY_JUMP, MIN_HELD_S = 0.2, 0.04
"""Size of a command's jump (duty), and the time (s) for which it must be constant before and after, for its
time to be determined."""
MIN_JUMPS = 12
"""Number of such jumps that is required."""
TRIED_OFFSETS = np.arange(-0.75, 1.76, 0.25)
"""Offsets in rows, before their own row, at which commands are simulated to begin. A filter that is not quite
right moves all of them alike, also to later times."""
FINE_OFFSETS = np.arange(-0.75, 1.751, 0.05)
"""Offsets in rows for which errors are interpolated between those."""
MAX_ERROR_RATIO, MAX_FINAL_ERROR_RATIO = 0.25, 0.08
"""Upper bounds on the error with a separate offset for each jump, relative to that with one common offset:
the first for separate offsets to be considered; the second, after the habits were fitted to commands that
begin so, for nothing else to be wrong. The first ratio was 0.02 to 0.24 for 17 loggers that read at once
(0.39 for one more), 0.11 to 0.34 for 24 that write the readings of a cycle of 5 ms, and 0.32 and more for 190
drives of controllers as slow as their rows, among them each cause and effects outside the catalogue. The
second was at most 0.06 for 15 of the first (0.5 for two), and 0.1 and more for the others."""
MIN_OFFSET_SPREAD = 0.25
"""Required interquartile range of the offsets, in rows. For a uniform distribution over a row it is half a
row."""
WHOLE_CYCLE_TOLERANCE = 0.1
"""Deviation of a row from a whole number of a controller's cycles, in cycles, up to which its rows are taken
as every second or third cycle of the controller itself, and not changed."""
MEAN_OFFSET_RANGE = (0.2, 0.5)
"""Bounds in rows on the mean offset of commands before their rows: half a row, less the age of the readings.
Within them it is the one that fits best with the filter in robot.toml."""
CHANGES_WITHIN_ROWS_NOTE = (
    "the wheels show that commands change within the row before the one that holds them, as if a logger with "
    "a clock of its own wrote the rows (controller.rate_hz is that of the driving program). "
)
TAKEN_AS_ANSWERED_NOTE = "Each is simulated from the moment that the wheels show"
ADVICE = "write rows from the driving program, each with what it has just read, or every 5 ms"


@dataclass(frozen=True, slots=True)
class CommandJumps:
    """Commands that jump. rows: the first row of each. answered: time in s in which the wheels respond to
    each."""

    rows: Rows
    answered: Array

    @classmethod
    def of(cls, log: Log) -> CommandJumps:
        """The jumps of a log that are large and held long enough to determine their times."""
        rows = _changed_rows(log)
        gaps = np.diff(log.time[rows], prepend=log.time[0], append=log.time[-1])
        sizes = np.abs(log.duty[rows] - log.duty[rows - 1]).max(axis=1)
        tell = (np.minimum(gaps[:-1], gaps[1:]) >= MIN_HELD_S) & (sizes >= MIN_DUTY_JUMP)
        tell &= log.time[rows] > log.time[0] + SETTLING_S + MIN_HELD_S
        return cls(rows[tell], np.minimum(gaps[1:], RESPONSE_S)[tell])


def _changed_rows(log: Log) -> Rows:
    """Rows with another command than the row before, if no row is missing between the two."""
    near = np.diff(log.time) < 1.5 * median_step(log.time)
    return np.flatnonzero(near & (np.diff(log.duty, axis=0) != 0.0).any(axis=1)) + 1


def place_commands(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None
) -> tuple[Log, HabitFit | None]:
    """The log with commands moved to the times of the wheels' responses if they certainly change within its
    rows, and the fit of habits (`fit_habits`) to it, if one was made.

    The log is returned unchanged if rows are as short as a usual cycle, or whole cycles of robot.toml's
    controller. If more than the commands' times is wrong, for example readings of other times than their
    rows, only a note is added.
    """
    cycles = median_step(log.time) * robot.controller.rate_hz
    several = round(cycles) > 1 and abs(cycles - round(cycles)) <= WHOLE_CYCLE_TOLERANCE
    if log.runs or sample_cycle_from_rows(log) == Chain().cycle or several:
        return log, None

    def placed_by(fit: HabitFit, max_error_ratio: float) -> Log | None:
        free_problem = free_problem_of(robot, causes, fit.habits, model)
        return with_commands_placed(log, free_problem, fit.point, max_error_ratio)

    fit = fit_habits(log, robot, causes, model)
    roughly = placed_by(fit, MAX_ERROR_RATIO)
    if roughly is None:
        return log, fit
    placed = placed_by(fit_habits(roughly, robot, causes, model), MAX_FINAL_ERROR_RATIO)
    if placed is None:
        note = f"{CHANGES_WITHIN_ROWS_NOTE}{ADVICE[0].upper()}{ADVICE[1:]}"
        return replace(log, notes=(*log.notes, note)), fit
    note = f"{CHANGES_WITHIN_ROWS_NOTE}{TAKEN_AS_ANSWERED_NOTE}; {ADVICE}"
    placed = replace(placed, notes=(*log.notes, note))
    return placed, fit_habits(placed, robot, causes, model)


def with_commands_placed(
    log: Log, problem_of: Callable[[Log], Problem], point: Point, max_error_ratio: float
) -> Log | None:
    """The log with each change of command at the time of the wheels' response in the simulation of `point`.

    None if the remaining error, relative to that with a common offset, exceeds `max_error_ratio`, or if all
    offsets are nearly equal.
    """
    jumps = CommandJumps.of(log)
    wheels = [index for index, each in enumerate(log.channels) if each.role in WHEELS]
    if len(jumps.rows) < MIN_JUMPS or not wheels:
        return None
    errors, nominal_errors = _errors_by_offset(log, jumps, problem_of, point, wheels)
    early, nominal_early = (FINE_OFFSETS[np.argmin(each, axis=1)] for each in (errors, nominal_errors))
    lower, upper = np.quantile(early, [0.25, 0.75])
    error_ratio = float(errors.min(axis=1).sum()) / float(errors.sum(axis=0).min())
    if error_ratio > max_error_ratio or upper - lower < MIN_OFFSET_SPREAD:
        return None
    mean = np.clip(nominal_early.mean(), *MEAN_OFFSET_RANGE)
    early = np.clip(early + mean - early.mean(), 0.0, 1.0)
    rows = _changed_rows(log)
    offsets = np.full(len(rows), mean)
    offsets[np.isin(rows, jumps.rows)] = early
    return with_earlier_commands(log, rows, offsets)


def _errors_by_offset(
    log: Log, jumps: CommandJumps, problem_of: Callable[[Log], Problem], point: Point, wheels: list[int]
) -> tuple[Array, Array]:
    """Squared errors of the wheels' response to each jump if it began so many rows earlier, (jumps,
    `FINE_OFFSETS`), in the simulation of a point and in that of robot.toml."""
    usual, row = problem_of(log), median_step(log.time)
    residuals = []
    for offset in TRIED_OFFSETS:
        moved = with_earlier_commands(log, jumps.rows, np.full(len(jumps.rows), offset))
        problem = in_bins_like(usual, problem_of(moved), moved)
        residuals.append((problem.features.measured - problem.predict([point, usual.nominal()]))[..., wheels])
    after = np.clip(np.searchsorted(TRIED_OFFSETS, FINE_OFFSETS), 1, len(TRIED_OFFSETS) - 1)
    share = (FINE_OFFSETS - TRIED_OFFSETS[after - 1]) / np.diff(TRIED_OFFSETS)[after - 1]
    share = share[:, None, None, None]
    time, tried, errors = usual.features.time, np.array(residuals), []
    for start, answered in zip(log.time[jumps.rows], jumps.answered, strict=True):
        near = tried[:, :, (time >= start - 1.5 * row) & (time < start + answered)]
        interpolated = (1.0 - share) * near[after - 1] + share * near[after]
        errors.append((interpolated**2).sum(axis=(2, 3)))
    by_point, nominal = np.array(errors).transpose(2, 0, 1)
    return by_point, nominal


def with_earlier_commands(log: Log, rows: Rows, early: Array) -> Log:
    """The log with the commands of these rows in force so many rows earlier, in new rows without readings."""
    moments = log.time[rows] - early * median_step(log.time)
    new = np.setdiff1d(moments, log.time)
    at = np.searchsorted(log.time, new)
    time, duty = np.insert(log.time, at, new), np.insert(log.duty, at, log.duty[at - 1], axis=0)
    brake = None if log.brake is None else np.insert(log.brake, at, log.brake[at - 1], axis=0)
    starts, own = np.searchsorted(time, moments), np.searchsorted(time, log.time[rows])
    for row, start, end in zip(rows, starts, own, strict=True):
        held = row if start < end else row - 1
        part = slice(min(start, end), max(start, end))
        duty[part] = log.duty[held]
        if brake is not None and log.brake is not None:
            brake[part] = log.brake[held]
    channels = tuple(replace(each, values=np.insert(each.values, at, np.nan)) for each in log.channels)
    return replace(log, time=time, duty=duty, channels=channels, brake=brake)
