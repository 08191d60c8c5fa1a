"""Faults of a speed reading itself, where a recording is too poor for a motor model.

A single power step with a coarse, filtered reading shows the reading's habits (a stale start that a filter
forgets, repeated samples) and when the motor began to move, but no motor constants: a step of one size at one
battery voltage has one steady speed, which K_E, friction and the reading's scale share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_DECAY_RATIO = 0.5
"""Of the one before, below which a sample is of a leftover that decays."""
MIN_MOVING_SHARE = 0.1
"""Of the usual reading later, from which a motor moves."""


@dataclass(frozen=True, slots=True)
class ReadingFaults:
    """What a step recording says of its reading.

    stale: the first value, where it is a leftover that decays (else None). decay: what a sample keeps of
    the one
    before while it is forgotten, so 1 - decay is the filter's share of the new (None without a stale start).
    repeats: share of samples that repeat the one before. dead_time: s from the command to the first motion.
    decay_std: deviation of decay.
    """

    stale: float | None
    decay: float | None
    repeats: float
    dead_time: float | None
    decay_std: float = 0.0


def reading_faults(time: Array, speed: Array) -> ReadingFaults:
    """Look at a reading (n,) recorded at `time` (n,) after one power step at time[0]; NaN is left out."""
    known = np.isfinite(speed)
    begin, time, speed = float(time[0]), time[known], speed[known]
    falling = _count_decaying(speed)
    ratios = speed[1 : falling + 1] / speed[:falling]
    # The first, largest ones are least disturbed by what was measured meanwhile.
    weights = speed[:falling] ** 2
    decay = float(ratios @ weights / weights.sum()) if falling >= 2 else None
    deviation = (
        1.4826 * float(np.median(np.abs(ratios - decay))) / np.sqrt(falling) if decay is not None else 0.0
    )
    repeats = float((np.diff(speed) == 0.0).mean()) if len(speed) > 1 else 0.0
    stale = float(speed[0]) if decay is not None else None
    return ReadingFaults(stale, decay, repeats, _dead_time(time - begin, speed, falling), float(deviation))


def _count_decaying(speed: Array) -> int:
    """How many samples from the first one each keep less than half of the one before, with its sign."""
    count = 0
    while (
        count + 1 < len(speed)
        and speed[count] != 0.0
        and 0.0 < speed[count + 1] / speed[count] < MAX_DECAY_RATIO
    ):
        count += 1
    return count


def _dead_time(time: Array, speed: Array, start: int) -> float | None:
    """First time after the stale start at which the reading passes a tenth of its later typical size. time:
    s since the command."""
    later = np.abs(speed[len(speed) // 2 :])
    limit = MIN_MOVING_SHARE * float(np.median(later))
    if not limit > 0.0:
        return None
    moving = np.flatnonzero(np.abs(speed[start:]) > limit)
    return float(time[start + moving[0]]) if len(moving) else None
