"""Commands that changed in rows which a recording lost: their times, from the wheels' response.

A recorder that drops a row drops its command. If the command has changed in the next row, it did so in one of
the cycles between, up to a whole gap before that row: 5 ms are 80 counts of error and more in the 0.2 s of a
wheel's response.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import WHEELS, Log
from raccoon.diagnose.fit.problem import Point, Problem

Array = NDArray[np.float64]

ROW_TOLERANCE = 0.25
"""Tolerance, in rows, of the usual rows' clock, and of a gap against a whole number of rows."""
MAX_GAP_S = 0.1
"""Largest gap in s. In longer ones a command may have changed several times."""
MIN_DUTY_JUMP = 0.1
"""Duty. A smaller change has little effect, whenever it came, and may be part of a ramp."""
RESPONSE_S = 0.15
"""Time in s in which a wheel responds to a command."""
MAX_LISTED = 5
"""Number of times that a note lists."""
MAX_CHANGES = 20
"""Number of changes that are placed, the largest first: each takes a simulation for every lost row."""


@dataclass(frozen=True, slots=True)
class LostChange:
    """A change of command in a gap. row: the first row after it. moments: times (s) of the lost rows, the
    latest first."""

    row: int
    moments: tuple[float, ...]


def find_lost_changes(log: Log) -> list[LostChange]:
    """The changes whose rows a log lost, in the order of time; empty if its rows follow no clock."""
    steps = np.diff(log.time)
    usual = float(np.median(steps))
    if np.mean(np.abs(steps - usual) > ROW_TOLERANCE * usual) > ROW_TOLERANCE:
        return []
    rows = np.rint(steps / usual)
    gap = (rows >= 2.0) & (np.abs(steps / usual - rows) < ROW_TOLERANCE) & (steps <= MAX_GAP_S)
    jumps = np.abs(np.diff(log.duty, axis=0)).max(axis=1)
    found = np.flatnonzero(gap & (jumps >= MIN_DUTY_JUMP))
    largest = np.sort(found[np.argsort(-jumps[found], kind="stable")][:MAX_CHANGES])
    return [
        LostChange(
            int(each) + 1, tuple(_times_of_lost_rows(log.time[each], log.time[each + 1], int(rows[each])))
        )
        for each in largest
    ]


def _times_of_lost_rows(start: float, end: float, rows: int) -> Array:
    """Times (s), the latest first, of the lost rows in a gap of so many rows."""
    return np.asarray(np.linspace(end, start, rows + 1)[1:-1], float)


def with_change_at(log: Log, change: LostChange, moment: float) -> Log:
    """The log with an additional row at that time, with the command of the row after the gap and no
    readings."""
    channels = tuple(
        replace(each, values=np.insert(each.values, change.row, np.nan)) for each in log.channels
    )
    time = np.insert(log.time, change.row, moment)
    duty = np.insert(log.duty, change.row, log.duty[change.row], axis=0)
    brake = None if log.brake is None else np.insert(log.brake, change.row, log.brake[change.row], axis=0)
    return replace(log, time=time, duty=duty, channels=channels, brake=brake)


def restore_lost_changes(log: Log, problem_of: Callable[[Log], Problem], point: Point) -> Log:
    """The log with every change at the time that fits the wheels' response best, in the simulation of
    `point`.

    A change stays in its recorded row if that fits as well: a loop that was late sent it then. Without wheels
    nothing is moved.
    """
    changes = find_lost_changes(log)
    wheels = [index for index, each in enumerate(log.channels) if each.role in WHEELS]
    if not changes or not wheels:
        return log
    usual = problem_of(log)
    time, squares = usual.features.time, _squared_wheel_errors(usual, point, wheels)
    chosen = []
    for change in changes:
        logs = [with_change_at(log, change, moment) for moment in change.moments]
        problems = (in_bins_like(usual, problem_of(each), each) for each in logs)
        errors = [squares, *(_squared_wheel_errors(each, point, wheels) for each in problems)]
        start = log.time[change.row - 1]
        answer = (time >= start) & (time < start + RESPONSE_S)
        best = int(np.argmin([each[answer].sum() for each in errors]))
        if best > 0:
            chosen.append((change, change.moments[best - 1]))
    if not chosen:
        return log
    for change, moment in reversed(chosen):  # from the end, so that row numbers stay valid
        log = with_change_at(log, change, moment)
    return replace(log, notes=(*log.notes, _describe_moments([moment for _, moment in chosen])))


def _describe_moments(moments: Sequence[float]) -> str:
    told = ", ".join(f"{each:.2f}" for each in moments[:MAX_LISTED]) + (
        ", ..." if len(moments) > MAX_LISTED else ""
    )
    rows = "a row in which a command" if len(moments) == 1 else "rows in which commands"
    return f"the recording lost {rows} changed: simulated as changed at {told} s, as the wheels show"


def in_bins_like(usual: Problem, problem: Problem, log: Log) -> Problem:
    """The problem of a log with an additional row, in bins as wide as those of the usual problem: if a loop
    changes commands, bins are as long as a command holds, and a moved command may change that."""
    width = usual.features.width
    if problem.features.width == width:
        return problem
    return replace(problem, features=Features.of(log, width))


def _squared_wheel_errors(problem: Problem, point: Point, wheels: Sequence[int]) -> Array:
    """Sum over the wheels of the squared residuals of each bin, (bins,)."""
    residual = (problem.features.measured - problem.predict([point])[0])[:, wheels]
    return np.asarray((residual**2).sum(axis=1), float)
