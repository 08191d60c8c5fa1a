"""Rows that are no drive from beginning to end: turned round, or two recordings one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.bins import low_pass
from raccoon.diagnose.drives.log import Channel, Log
from raccoon.diagnose.drives.response_models import (
    MAX_FOLLOWED_UNEXPLAINED,
    MIN_READINGS,
    SIMPLE_TIME_CONSTANTS_S,
    DelayScan,
    residual_power,
)
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]

MAX_REVERSED_ERROR_RATIO = 0.5
"""Part of the error that is left where commands are taken to follow the readings, from which they do. Where
they do not it is at least 1."""
MIN_REVERSED_ERROR_FACTOR = 1.08
"""Times the error of late commands that the opposite order has where they are late. It was 1.17 at least
there, and 0.98 at most of drives that were turned round."""
MAX_READING_STEP_S = 0.0125
"""s between readings up to which a wheel that stops takes several of them: the fastest answer in 20 ms."""
ROW_TOLERANCE = 0.3
"""Part of the usual row by which one may be longer, where nothing is lost."""
BOTH_JUMP_SHARE, SINGLE_JUMP_SHARE = 0.08, 0.25
"""Parts of the largest reading by which both wheels jump, or one by itself."""
MAX_MOVE_AROUND_JUMP = 0.3
"""Part of a jump that the reading moves by just before and after it, together. A wheel that stops at once
goes on with 0.6 of it and more, and a spike goes back by all of it."""
READINGS_AROUND, MAX_SINGLE_MOVE = 3, 0.6
"""Readings around a jump, and the part of it by which none of them may move: where a reading is now and then
a row late, a wheel that is turned round goes through 0 in steps of a tenth of the largest reading, and stands
in between."""


def check_row_order(log: Log) -> None:
    """Raise TraceError where readings come before their commands, or jump as none does."""
    wheels = [log.wheel(side) for side in ("left", "right")]
    measured = [each for each in wheels if each is not None and each.unit == "counts"]
    if len(measured) < len(wheels):
        return
    before = all(_is_reversed(log, index, each) for index, each in enumerate(measured))
    if before and not _is_late_instead(log, measured):
        raise TraceError(
            f"{measured[0].name} and {measured[1].name} change before their commands do, from row 0 to "
            f"{len(log.time) - 1}: the rows are in the opposite order. Rows must be in the order of time, "
            "each with the commands from then on"
        )
    near, far = (
        np.array([_find_jumps(log.time, each.values, share) for each in measured])
        for share in (BOTH_JUMP_SHARE, SINGLE_JUMP_SHARE)
    )
    found = np.flatnonzero(near.all(axis=0) | far.any(axis=0))
    if len(found):
        row = int(found[0])
        wheel = measured[int(np.argmax(far[:, row] | near[:, row]))]
        last = wheel.values[:row][np.isfinite(wheel.values[:row])][-1]
        raise TraceError(
            f"{wheel.name} goes from {last:g} to {wheel.values[row]:g} counts at row {row} "
            f"(t = {log.time[row]:.6g} s), and stays there: no wheel does, so two recordings seem to be put "
            "together. A recording must be of one drive: diagnose each by itself"
        )


def _is_reversed(log: Log, index: int, wheel: Channel) -> bool:
    """Whether commands follow a wheel's readings, and not the other way round."""
    known = np.isfinite(wheel.values)
    if known.sum() < MIN_READINGS:
        return False
    step = median_step(log.time)
    duty, reading = log.duty[known, index], wheel.values[known]
    power = float(np.var(reading))
    ahead, behind = (
        min(residual_power(low_pass(command, step, each), answer) for each in SIMPLE_TIME_CONSTANTS_S)
        for command, answer in ((duty, reading), (duty[::-1], reading[::-1]))
    )
    return behind < MAX_REVERSED_ERROR_RATIO * ahead and behind < MAX_FOLLOWED_UNEXPLAINED * power


def _is_late_instead(log: Log, wheels: Sequence[Channel]) -> bool:
    """Whether a delay of the commands explains the readings better than the opposite order does."""
    left = []
    for index, each in enumerate(wheels):
        turned = replace(each, values=each.values[::-1])
        ways = ((each, log.duty[:, index]), (turned, log.duty[::-1, index]))
        asked = [(DelayScan.of(log.time, channel), duty) for channel, duty in ways]
        left.append(
            [1.0 if one is None else one.response_of_simple_wheel(duty).unexplained for one, duty in asked]
        )
    late, back = np.sum(left, axis=0)
    return bool(late * MIN_REVERSED_ERROR_FACTOR < back)


def _find_jumps(time: Array, values: Array, share: float) -> NDArray[np.bool_]:
    """Rows (rows,) at which a reading is at once where it stays, that part of the largest reading away."""
    found = np.zeros(len(values), bool)
    known = np.flatnonzero(np.isfinite(values))
    fresh = known[np.concatenate([[True], np.diff(values[known]) != 0.0])] if len(known) else known
    if len(fresh) < MIN_READINGS or median_step(time[fresh]) > MAX_READING_STEP_S:
        return found
    moved, steps = np.diff(values[fresh]), np.diff(time)
    least = share * float(np.percentile(np.abs(values[known]), 99.0))
    size = np.abs(moved)
    around = size[:-2] + size[2:]
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(size, READINGS_AROUND), 2 * READINGS_AROUND + 1)
    beside = np.delete(windows, READINGS_AROUND, axis=1).max(axis=1)[1:-1]
    # A wheel that was too fast to be read for a while has no readings then, and may be anywhere after it.
    known_until = np.diff(time[fresh])[1:-1] <= MAX_READING_STEP_S
    jump = size[1:-1]
    rows = fresh[2:-1][
        known_until
        & (jump > least)
        & (around < MAX_MOVE_AROUND_JUMP * jump)
        & (beside < MAX_SINGLE_MOVE * jump)
    ]
    found[rows] = steps[rows - 1] < (1.0 + ROW_TOLERANCE) * float(np.median(steps))
    return found
