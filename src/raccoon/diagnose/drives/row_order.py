"""Checks that the rows are one drive in time order: not reversed, and not two recordings in sequence."""

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
"""Largest ratio of the error in reversed order (commands after their readings) to that in the given order,
for rows that are reversed. For other rows it is at least 1."""
MIN_REVERSED_ERROR_FACTOR = 1.08
"""Factor on the error of delayed commands up to which the reversed order counts as better. The ratio of the
errors (reversed to delayed) was at least 1.17 for late commands, and at most 0.98 for reversed drives."""
MAX_READING_STEP_S = 0.0125
"""Longest time between readings, s, for the search of jumps: with it a wheel that stops takes several
readings, as the fastest response takes 20 ms."""
ROW_TOLERANCE = 0.3
"""Relative tolerance on the usual row duration, beyond which rows are lost."""
BOTH_JUMP_SHARE, SINGLE_JUMP_SHARE = 0.08, 0.25
"""Least jump, as a share of the largest reading: of both wheels at once, and of a single one."""
MAX_MOVE_AROUND_JUMP = 0.3
"""Largest movement just before and after a jump together, as a share of the jump. A wheel that stops at once
goes on with 0.6 of it and more, and a spike goes back by all of it."""
READINGS_AROUND, MAX_SINGLE_MOVE = 3, 0.6
"""Number of readings on either side of a jump, and largest step between them as a share of the jump. If
readings are now and then a row late, a reversing wheel passes 0 in steps of a tenth of the largest reading
with stops in between, which is no jump."""


def check_row_order(log: Log) -> None:
    """Raise TraceError if readings come before their commands, or jump as no wheel does."""
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
    """Whether the commands follow a wheel's readings rather than precede them."""
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
    """Whether a delay of the commands explains the readings better than the reversed order does."""
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
    """Flags (rows,) of rows at which a reading jumps by at least `share` of the largest reading and stays
    there."""
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
    # A wheel that is too fast for its sensor has no readings for a while, and may have any speed after that.
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
