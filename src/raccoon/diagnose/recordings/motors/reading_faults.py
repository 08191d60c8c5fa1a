"""Faults of a speed reading in a step response, which is not enough for a motor model.

A single power step with a coarse, filtered reading shows faults of the reading (a stale start that decays in
the filter, repeated samples) and when the motor began to move, but no motor constants: one step at one
battery voltage has one steady speed, on which K_E, friction and the reading's scale act alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_DECAY_RATIO = 0.5
"""Ratio of a sample to the one before below which both belong to a decaying stale value."""
MIN_MOVING_SHARE = 0.1
"""Reading of a moving motor, as a share of the typical later one."""


@dataclass(frozen=True, slots=True)
class ReadingFaults:
    """Faults of a reading in a step response.

    stale: first value, if it is stale and decays (else None). decay: ratio of successive samples during the
    decay, so 1 - decay is the filter's gain (None without a stale start). repeats: share of samples that
    equal the one before. dead_time: from the command to the first motion, s. decay_std: standard deviation of
    decay.
    """

    stale: float | None
    decay: float | None
    repeats: float
    dead_time: float | None
    decay_std: float = 0.0


def reading_faults(time: Array, speed: Array) -> ReadingFaults:
    """Examine a reading (n,) at `time` (n,) after a single power step at time[0]; NaN values are left out."""
    known = np.isfinite(speed)
    begin, time, speed = float(time[0]), time[known], speed[known]
    falling = _count_decaying(speed)
    ratios = speed[1 : falling + 1] / speed[:falling]
    # The first, largest samples are least disturbed by new measurements.
    weights = speed[:falling] ** 2
    decay = float(ratios @ weights / weights.sum()) if falling >= 2 else None
    deviation = (
        1.4826 * float(np.median(np.abs(ratios - decay))) / np.sqrt(falling) if decay is not None else 0.0
    )
    repeats = float((np.diff(speed) == 0.0).mean()) if len(speed) > 1 else 0.0
    stale = float(speed[0]) if decay is not None else None
    return ReadingFaults(stale, decay, repeats, _dead_time(time - begin, speed, falling), float(deviation))


def _count_decaying(speed: Array) -> int:
    """Number of samples from the first one that are each less than half of the one before, with the same
    sign."""
    count = 0
    while (
        count + 1 < len(speed)
        and speed[count] != 0.0
        and 0.0 < speed[count + 1] / speed[count] < MAX_DECAY_RATIO
    ):
        count += 1
    return count


def _dead_time(time: Array, speed: Array, start: int) -> float | None:
    """First time after the stale start at which the reading exceeds a tenth of its typical later size. time:
    since the command, s."""
    later = np.abs(speed[len(speed) // 2 :])
    limit = MIN_MOVING_SHARE * float(np.median(later))
    if not limit > 0.0:
        return None
    moving = np.flatnonzero(np.abs(speed[start:]) > limit)
    return float(time[start + moving[0]]) if len(moving) else None
