"""Levels of a tophat that move with time: a step, or a drift."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.levels import PIECES, SAME_UNIT, Levels, levels_of, pair_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CLEAR = 5.0
"""Deviations by which a level must move to have moved."""
FEWEST_PIECES = 3
"""Pieces of time with a level, from which it may have moved."""
MOMENTS = 40
"""Parts of a recording between which a step is looked for at first."""
NEARER = 0.5
"""Share of their distance from two levels that readings must keep from two pairs of levels, one before and
one after a step, where the two alone do not show that they moved: what a step makes of them may pass for
edges."""

FAR = 5.0
"""Usual distances from its level beyond which a reading tells no more of when a step was."""


def move(levels: Levels) -> tuple[float, float, float] | None:
    """By how many counts a level moves at the most, and when it is lowest and highest (s); None where both
    stand."""
    table = levels.means(np.ones(len(levels.time), np.bool_))
    found: list[tuple[float, float, float]] = []
    length = float(np.ptp(levels.time)) / PIECES
    for side in (0.0, 1.0):
        mine = table[table[:, 1] == side]
        if len(mine) < FEWEST_PIECES or not _apart(mine):
            continue
        ends = mine[int(np.argmin(mine[:, 2])), 0], mine[int(np.argmax(mine[:, 2])), 0]
        lowest, highest = (float(levels.time[0]) + (float(each) + 0.5) * length for each in ends)
        found.append((float(np.ptp(mine[:, 2])), lowest, highest))
    return max(found) if found else None


def _apart(rows: Array) -> bool:
    """Whether two of the levels are further apart than they may be off, each by its own deviation. rows: of
    one surface, of `Levels.means`."""
    return any(
        abs(one[2] - two[2]) >= CLEAR * float(np.hypot(np.hypot(one[3], two[3]), SAME_UNIT))
        for one, two in combinations(rows, 2)
    )


def at_a_step(
    time: Array, counts: Array, surface: Array | None, whole: Levels | str
) -> tuple[float, Levels, Levels] | None:
    """When (s) the levels jump, and the levels before and after, each sorted by itself; None where they do
    not, or do not stand apart from that. whole: what all readings together are sorted into.

    Light that lowers both levels makes white of black, where the readings have to tell: so when it came on
    is found by all of them, sorted or not.
    """
    known = np.isfinite(counts)
    time, counts = time[known], counts[known]
    surface = None if surface is None else surface[known]
    moved = not isinstance(whole, str) and move(whole) is not None
    if len(time) < 2 or (surface is not None and not moved):
        return None
    row = _best_row(time, counts, None if surface is None else surface > 0.5, 1.0 if moved else NEARER)
    if row is None:
        return None
    parts = [
        levels_of(time[part], counts[part], None if surface is None else surface[part])
        for part in (slice(row), slice(row, None))
    ]
    before, after = parts
    if isinstance(before, str) or isinstance(after, str) or not _differ(before, after):
        return None
    if move(before) is not None or move(after) is not None:
        return None
    surely = before.sorted_surely or after.sorted_surely
    if not isinstance(whole, str):
        surely = surely or whole.sorted_surely
    when = 0.5 * float(time[row - 1] + time[row])
    return when, replace(before, sorted_surely=surely), replace(after, sorted_surely=surely)


def _differ(before: Levels, after: Levels) -> bool:
    """Whether white or black moved by more than both may be off."""
    tables = [each.both(np.ones(len(each.time), np.bool_)) for each in (before, after)]
    return any(_apart(np.array([[0.0, *one], [1.0, *two]])) for one, two in zip(*tables, strict=True))


def _best_row(time: Array, counts: Array, black: Flags | None, most: float) -> int | None:
    """The first reading after a step: two levels before it and two after it are nearer to all readings than
    with any other, and leave at most the share `most` of what two levels leave."""
    alone = pair_of(counts, black)
    ends = np.searchsorted(time, np.linspace(time[0], time[-1], MOMENTS + 1))
    rows = []
    for place in range(1, MOMENTS):
        sides = _sides(counts, black, int(ends[place]))
        if sides is None or ends[place - 1] == ends[place + 1]:  # in a gap there is nothing
            continue
        # White of before may pass for black of after where a moment is a little off: so moments are compared
        # once each is where its levels put it.
        row = _moment(sides, int(ends[place]), int(ends[place - 1]), int(ends[place + 1]))
        there = _sides(counts, black, row)
        if there is not None:
            rows.append((_cost(there, row), row))
    if not rows:
        return None
    cost, row = min(rows)
    if alone is not None and cost > most * float(_away(counts, black, alone).sum()):
        return None
    return row


def _sides(counts: Array, black: Flags | None, row: int) -> tuple[Array, Array] | None:
    """Of all readings how far they are from the levels before the row, and from those after it; None where
    not both surfaces are seen on either side."""
    parts = slice(row), slice(row, None)
    pairs = [pair_of(counts[each], None if black is None else black[each]) for each in parts]
    if pairs[0] is None or pairs[1] is None:
        return None
    return _away(counts, black, pairs[0]), _away(counts, black, pairs[1])


def _cost(sides: tuple[Array, Array], row: int) -> float:
    """Counts that all readings together are from their levels."""
    return float(sides[0][:row].sum() + sides[1][row:].sum())


def _moment(sides: tuple[Array, Array], row: int, first: int, last: int) -> int:
    """The row from first to last at which the levels best give way to the others; they are of `row`."""
    # Readings on an edge are far from the levels, and may happen to be near those of the other side.
    most = FAR * float(np.median(np.append(sides[0][:row], sides[1][row:])))
    sooner, later = (np.minimum(each[first:last], most) for each in sides)
    return min(first + 1 + int(np.argmin(np.cumsum(sooner - later))), len(sides[0]) - 1)


def _away(counts: Array, black: Flags | None, pair: tuple[float, float]) -> Array:
    """Counts from the level of its surface, or else from the nearer one."""
    white, dark = np.abs(counts - pair[0]), np.abs(counts - pair[1])
    return np.minimum(white, dark) if black is None else np.where(black, dark, white)
