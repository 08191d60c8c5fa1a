"""Levels of a tophat that move with time: a step, or a drift."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.levels import FEWEST, PIECES, SAME_UNIT, Levels

Array = NDArray[np.float64]

CLEAR = 5.0
"""Deviations by which a level must move to have moved."""
FEWEST_PIECES = 3


def move(levels: Levels) -> tuple[float, float, float] | None:
    """By how many counts a level moves at the most, and when it is lowest and highest (s); None where both
    stand."""
    table = levels.means(np.ones(len(levels.time), np.bool_))
    found: list[tuple[float, float, float]] = []
    length = float(np.ptp(levels.time)) / PIECES
    for side in (0.0, 1.0):
        mine = table[table[:, 1] == side]
        if len(mine) < FEWEST_PIECES:
            continue
        size = float(np.ptp(mine[:, 2]))
        if size >= CLEAR * float(np.hypot(np.median(mine[:, 3]), SAME_UNIT)):
            ends = mine[int(np.argmin(mine[:, 2])), 0], mine[int(np.argmax(mine[:, 2])), 0]
            lowest, highest = (float(levels.time[0]) + (float(each) + 0.5) * length for each in ends)
            found.append((size, lowest, highest))
    return max(found) if found else None


def at_a_step(levels: Levels) -> tuple[float, Levels, Levels] | None:
    """When (s) the levels jump, and the levels before and after, where both stand apart from that."""
    row = _best_change(levels)
    if row is None:
        return None
    early = np.arange(len(levels.time)) <= row
    before, after = levels.part(early), levels.part(~early)
    if before is None or after is None or move(before) is not None or move(after) is not None:
        return None
    return 0.5 * float(levels.time[row] + levels.time[row + 1]), before, after


def _best_change(levels: Levels) -> int | None:
    """The reading after which two levels a surface, one before and one after, fit best."""
    gained = np.zeros(len(levels.time))
    allowed = np.ones(len(levels.time), np.bool_)
    for side in (False, True):
        mine = levels.black == side
        values = np.where(mine, levels.counts - levels.counts[mine].mean(), 0.0)
        count, total = np.cumsum(mine), np.cumsum(values)
        rest = count[-1] - count
        allowed &= (count >= FEWEST) & (rest >= FEWEST)
        gained += total**2 / np.maximum(count, 1) + (total[-1] - total) ** 2 / np.maximum(rest, 1)
    return int(np.argmax(np.where(allowed, gained, -1.0))) if allowed.any() else None
