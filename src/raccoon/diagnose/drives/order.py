"""Rows that are no drive from beginning to end: turned round, or two recordings one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.binned import low_passed
from raccoon.diagnose.drives.followers import ANSWERS, FEWEST, FOLLOWED, Asked, unexplained
from raccoon.diagnose.drives.log import Channel, Log
from raccoon.trace.recording import usual_step

Array = NDArray[np.float64]

LESS = 0.5
"""Part of the error that is left where commands are taken to follow the readings, from which they do. Where
they do not it is at least 1."""
ONLY_LATE = 1.08
"""Times the error of late commands that the opposite order has where they are late. It was 1.17 at least
there, and 0.98 at most of drives that were turned round."""
CLOSE = 0.0125
"""s between readings up to which a wheel that stops takes several of them: the fastest answer in 20 ms."""
EVEN = 0.3
"""Part of the usual row by which one may be longer, where nothing is lost."""
FAR, ALONE = 0.08, 0.25
"""Parts of the largest reading by which both wheels jump, or one by itself."""
REST = 0.3
"""Part of a jump that the reading moves by just before and after it, together. A wheel that stops at once
goes on with 0.6 of it and more, and a spike goes back by all of it."""
NEAR, LIKE = 3, 0.6
"""Readings around a jump, and the part of it by which none of them may move: where a reading is now and then
a row late, a wheel that is turned round goes through 0 in steps of a tenth of the largest reading, and stands
in between."""


def check_order(log: Log) -> None:
    """Raise TraceError where readings come before their commands, or jump as none does."""
    wheels = [log.wheel(side) for side in ("left", "right")]
    measured = [each for each in wheels if each is not None and each.unit == "counts"]
    if len(measured) < len(wheels):
        return
    before = all(_answers_before(log, index, each) for index, each in enumerate(measured))
    if before and not _only_late(log, measured):
        raise TraceError(
            f"{measured[0].name} and {measured[1].name} change before their commands do, from row 0 to "
            f"{len(log.time) - 1}: the rows are in the opposite order. Rows must be in the order of time, "
            "each with the commands from then on"
        )
    near, far = (
        np.array([_jumps(log.time, each.values, share) for each in measured]) for share in (FAR, ALONE)
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


def _answers_before(log: Log, index: int, wheel: Channel) -> bool:
    """Whether commands follow a wheel's readings, and not the other way round."""
    known = np.isfinite(wheel.values)
    if known.sum() < FEWEST:
        return False
    step = usual_step(log.time)
    duty, reading = log.duty[known, index], wheel.values[known]
    power = float(np.var(reading))
    ahead, behind = (
        min(unexplained(low_passed(command, step, each), answer) for each in ANSWERS)
        for command, answer in ((duty, reading), (duty[::-1], reading[::-1]))
    )
    return behind < LESS * ahead and behind < FOLLOWED * power


def _only_late(log: Log, wheels: Sequence[Channel]) -> bool:
    """Whether a delay of the commands explains the readings better than the opposite order does."""
    left = []
    for index, each in enumerate(wheels):
        turned = replace(each, values=each.values[::-1])
        ways = ((each, log.duty[:, index]), (turned, log.duty[::-1, index]))
        asked = [(Asked.of(log.time, channel), duty) for channel, duty in ways]
        left.append([1.0 if one is None else one.of_one(duty).left for one, duty in asked])
    late, back = np.sum(left, axis=0)
    return bool(late * ONLY_LATE < back)


def _jumps(time: Array, values: Array, share: float) -> NDArray[np.bool_]:
    """Rows (rows,) at which a reading is at once where it stays, that part of the largest reading away."""
    found = np.zeros(len(values), bool)
    known = np.flatnonzero(np.isfinite(values))
    fresh = known[np.concatenate([[True], np.diff(values[known]) != 0.0])] if len(known) else known
    if len(fresh) < FEWEST or usual_step(time[fresh]) > CLOSE:
        return found
    moved, steps = np.diff(values[fresh]), np.diff(time)
    least = share * float(np.percentile(np.abs(values[known]), 99.0))
    size = np.abs(moved)
    around = size[:-2] + size[2:]
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(size, NEAR), 2 * NEAR + 1)
    beside = np.delete(windows, NEAR, axis=1).max(axis=1)[1:-1]
    # A wheel that was too fast to be read for a while has no readings then, and may be anywhere after it.
    known_until = np.diff(time[fresh])[1:-1] <= CLOSE
    jump = size[1:-1]
    rows = fresh[2:-1][known_until & (jump > least) & (around < REST * jump) & (beside < LIKE * jump)]
    found[rows] = steps[rows - 1] < (1.0 + EVEN) * float(np.median(steps))
    return found
