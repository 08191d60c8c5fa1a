"""Commands that changed within the row before theirs: a logger beside the program that drives.

Such a logger sleeps for 8 or 10 ms and then writes the last command and the last readings, while commands go
whenever the program gives them. Each has then begun up to a row before its own, and of 8 ms that looks like
friction, inertia and a wheel's slip. Wheels tell when: a jump that changes a speed by 1000 counts in 50 ms
is known to a tenth of a row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.features import SETTLING
from raccoon.diagnose.drives.log import WHEELS, Log
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.controller import cycle_by_row, nearest
from raccoon.diagnose.habits.loose import Fitted
from raccoon.diagnose.habits.lost import ANSWER, in_bins_of
from raccoon.diagnose.habits.problems import loose_problem_of
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.recording import usual_step

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

JUMP, HELD = 0.2, 0.04
"""Duty by which a command must jump, and s for which it must hold before and after, to tell when."""
FEWEST = 12
"""Such jumps."""
STEPS = np.arange(-0.75, 1.76, 0.25)
"""Rows by which commands are tried to have begun before their own. A filter that is not quite right moves all
of them alike, later ones as well."""
FINE = np.arange(-0.75, 1.751, 0.05)
"""The same, between which errors are lines."""
TOGETHER, PLACED = 0.25, 0.08
"""Part of the error at one moment for all jumps that is left at each one's own: where each has its own,
and where that is all that is wrong, once the habits are those of commands that begin so. The first was 0.02
to 0.24 of 17 loggers that read at once (0.39 of one more), 0.11 to 0.34 of 24 that write the readings of a
cycle of 5 ms, and 0.32 and more of 190 drives of controllers as slow as their rows, each cause and what no
catalogue has among them. The second was 0.06 at most of 15 of the first (0.5 of two), 0.1 and more of the
others."""
APART = 0.25
"""Rows between the quartiles of these moments. Were any moment as likely, it would be half a row."""
WHOLE = 0.1
"""Part of a controller's cycle by which rows may be another than several whole ones. Such are every second
row of a controller's own, and not asked."""
MIDDLE = (0.2, 0.5)
"""Rows by which commands begin before theirs, on the average: by half of one, less what readings are old.
Which it is the filter tells that robot.toml has."""
ASIDE = (
    "commands change within the row before the one that holds them, as the wheels answer: a logger with a "
    "clock of its own writes so, beside the program that commands (controller.rate_hz is that program's). "
)
TAKEN = "Each is taken to begin when the wheels say"
BETTER = "write rows from the program that commands, each with what it has just read, or every 5 ms"


@dataclass(frozen=True, slots=True)
class Jumps:
    """Commands that jump, by their rows, and the s in which wheels answer each."""

    rows: Rows
    answered: Array

    @classmethod
    def of(cls, log: Log) -> Jumps:
        """Those of a log that tell when they came."""
        rows = _changed(log)
        gaps = np.diff(log.time[rows], prepend=log.time[0], append=log.time[-1])
        sizes = np.abs(log.duty[rows] - log.duty[rows - 1]).max(axis=1)
        tell = (np.minimum(gaps[:-1], gaps[1:]) >= HELD) & (sizes >= JUMP)
        tell &= log.time[rows] > log.time[0] + SETTLING + HELD
        return cls(rows[tell], np.minimum(gaps[1:], ANSWER)[tell])


def _changed(log: Log) -> Rows:
    """Rows with another command than the one before, which no lost row lies between."""
    near = np.diff(log.time) < 1.5 * usual_step(log.time)
    return np.flatnonzero(near & (np.diff(log.duty, axis=0) != 0.0).any(axis=1)) + 1


def as_commanded(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None
) -> tuple[Log, Fitted | None]:
    """The log with commands where the wheels answer them, if those surely change within its rows, and what is
    `nearest` to it, if that was asked for.

    The same log where rows are as short as a usual cycle, or whole cycles of robot.toml's controller. Where
    more than the commands' moments is wrong, as where readings are of other moments than their rows, it is
    only said.
    """
    cycles = usual_step(log.time) * robot.controller.rate_hz
    several = round(cycles) > 1 and abs(cycles - round(cycles)) <= WHOLE
    if log.runs or cycle_by_row(log) == Chain().cycle or several:
        return log, None

    def placed_by(found: Fitted, together: float) -> Log | None:
        return placed(log, loose_problem_of(robot, causes, found.habits, model), found.point, together)

    found = nearest(log, robot, causes, model)
    roughly = placed_by(found, TOGETHER)
    if roughly is None:
        return log, found
    better = placed_by(nearest(roughly, robot, causes, model), PLACED)
    if better is None:
        return replace(log, notes=(*log.notes, f"{ASIDE}{BETTER[0].upper()}{BETTER[1:]}")), found
    better = replace(better, notes=(*log.notes, f"{ASIDE}{TAKEN}; {BETTER}"))
    return better, nearest(better, robot, causes, model)


def placed(log: Log, problem_of: Callable[[Log], Problem], point: Point, together: float) -> Log | None:
    """The log with each change of command where the wheels answer it in the simulation of `point`; None where
    more than that part of the error at one moment for all would be left, or all have one."""
    jumps = Jumps.of(log)
    wheels = [index for index, each in enumerate(log.channels) if each.role in WHEELS]
    if len(jumps.rows) < FEWEST or not wheels:
        return None
    errors, nominal = _errors(log, jumps, problem_of, point, wheels)
    early, as_told = (FINE[np.argmin(each, axis=1)] for each in (errors, nominal))
    lower, upper = np.quantile(early, [0.25, 0.75])
    left = float(errors.min(axis=1).sum()) / float(errors.sum(axis=0).min())
    if left > together or upper - lower < APART:
        return None
    middle = np.clip(as_told.mean(), *MIDDLE)
    early = np.clip(early + middle - early.mean(), 0.0, 1.0)
    rows = _changed(log)
    every = np.full(len(rows), middle)
    every[np.isin(rows, jumps.rows)] = early
    return begun_before(log, rows, every)


def _errors(
    log: Log, jumps: Jumps, problem_of: Callable[[Log], Problem], point: Point, wheels: list[int]
) -> tuple[Array, Array]:
    """Squared errors of the wheels' answer to each jump, had it come so many rows before, (jumps, FINE), in
    the simulation of a point and in that of robot.toml."""
    usual, row = problem_of(log), usual_step(log.time)
    left = []
    for step in STEPS:
        tried = begun_before(log, jumps.rows, np.full(len(jumps.rows), step))
        problem = in_bins_of(usual, problem_of(tried), tried)
        left.append((problem.features.measured - problem.predict([point, usual.nominal()]))[..., wheels])
    after = np.clip(np.searchsorted(STEPS, FINE), 1, len(STEPS) - 1)
    share = ((FINE - STEPS[after - 1]) / np.diff(STEPS)[after - 1])[:, None, None, None]
    time, residuals, found = usual.features.time, np.array(left), []
    for start, answered in zip(log.time[jumps.rows], jumps.answered, strict=True):
        near = residuals[:, :, (time >= start - 1.5 * row) & (time < start + answered)]
        between = (1.0 - share) * near[after - 1] + share * near[after]
        found.append((between**2).sum(axis=(2, 3)))
    by_point, nominal = np.array(found).transpose(2, 0, 1)
    return by_point, nominal


def begun_before(log: Log, rows: Rows, early: Array) -> Log:
    """The log with the commands of these rows begun so many rows before, in rows without a reading."""
    moments = log.time[rows] - early * usual_step(log.time)
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
