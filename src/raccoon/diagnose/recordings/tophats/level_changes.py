"""Detects levels of a tophat that change over time: a step, or a drift."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.levels import (
    SENSOR_SPREAD,
    TIME_PIECES,
    SurfaceLevels,
    level_pair,
    sort_levels,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MIN_MOVE_SIGMAS = 5.0
"""Least significant movement of a level, in standard deviations."""
MIN_PIECES = 3
"""Least number of pieces of time with a level for the detection of a movement."""
STEP_CANDIDATES = 40
"""Number of parts of a recording between which a step is searched first."""
MAX_COST_RATIO = 0.5
"""Ratio of the readings' distance from two pairs of levels (before and after a step) to that from a single
pair, below which a step is accepted although single levels showed no movement: its readings may pass for
edges."""

MAX_DISTANCE_RATIO = 5.0
"""Cap on a reading's distance from its level, in median distances, in the search for the time of a step."""


def find_movement(levels: SurfaceLevels) -> tuple[float, float, float] | None:
    """Largest movement of a level, counts, and the times at which it is lowest and highest, s; None if both
    levels are constant."""
    table = levels.piece_levels(np.ones(len(levels.time), np.bool_))
    found: list[tuple[float, float, float]] = []
    length = float(np.ptp(levels.time)) / TIME_PIECES
    for side in (0.0, 1.0):
        mine = table[table[:, 1] == side]
        if len(mine) < MIN_PIECES or not _differ_significantly(mine):
            continue
        extremes = mine[int(np.argmin(mine[:, 2])), 0], mine[int(np.argmax(mine[:, 2])), 0]
        lowest, highest = (float(levels.time[0]) + (float(each) + 0.5) * length for each in extremes)
        found.append((float(np.ptp(mine[:, 2])), lowest, highest))
    return max(found) if found else None


def _differ_significantly(rows: Array) -> bool:
    """Whether any two of the levels differ significantly. rows: of one surface, from
    `SurfaceLevels.piece_levels`."""
    return any(
        abs(one[2] - two[2]) >= MIN_MOVE_SIGMAS * float(np.hypot(np.hypot(one[3], two[3]), SENSOR_SPREAD))
        for one, two in combinations(rows, 2)
    )


def split_at_step(
    time: Array, counts: Array, surface: Array | None, levels: SurfaceLevels | str
) -> tuple[float, SurfaceLevels, SurfaceLevels] | None:
    """Time of a jump of the levels, s, and the levels before and after, each sorted separately; None if they
    do not jump, or are not constant otherwise. levels: of all readings together, or the reason for having
    none.

    Without labels, light that lowers both levels can make black read as white did before, so the time of the
    step is determined from all readings, sorted or not.
    """
    known = np.isfinite(counts)
    time, counts = time[known], counts[known]
    surface = None if surface is None else surface[known]
    has_moved = not isinstance(levels, str) and find_movement(levels) is not None
    if len(time) < 2 or (surface is not None and not has_moved):
        return None
    row = _find_step_row(
        time, counts, None if surface is None else surface > 0.5, 1.0 if has_moved else MAX_COST_RATIO
    )
    if row is None:
        return None
    parts = [
        sort_levels(time[part], counts[part], None if surface is None else surface[part])
        for part in (slice(row), slice(row, None))
    ]
    before, after = parts
    if isinstance(before, str) or isinstance(after, str) or not _levels_differ(before, after):
        return None
    if find_movement(before) is not None or find_movement(after) is not None:
        return None
    is_certain = before.is_sorting_certain or after.is_sorting_certain
    if not isinstance(levels, str):
        is_certain = is_certain or levels.is_sorting_certain
    when = 0.5 * float(time[row - 1] + time[row])
    return when, replace(before, is_sorting_certain=is_certain), replace(after, is_sorting_certain=is_certain)


def _levels_differ(before: SurfaceLevels, after: SurfaceLevels) -> bool:
    """Whether white or black moved significantly."""
    tables = [each.surface_levels(np.ones(len(each.time), np.bool_)) for each in (before, after)]
    return any(
        _differ_significantly(np.array([[0.0, *one], [1.0, *two]])) for one, two in zip(*tables, strict=True)
    )


def _find_step_row(time: Array, counts: Array, black: Flags | None, max_ratio: float) -> int | None:
    """Row of the first reading after a step, at which two levels before and two after fit the readings best;
    None if they do not reduce the distance from a single pair of levels to `max_ratio` of it."""
    single_pair = level_pair(counts, black)
    ends = np.searchsorted(time, np.linspace(time[0], time[-1], STEP_CANDIDATES + 1))
    rows = []
    for place in range(1, STEP_CANDIDATES):
        distances = _distances_before_and_after(counts, black, int(ends[place]))
        if distances is None or ends[place - 1] == ends[place + 1]:  # a gap has no readings
            continue
        # If a candidate is slightly off, white before may pass for black after, so candidates are compared
        # after each was refined by its own levels.
        row = _refine_step_row(distances, int(ends[place]), int(ends[place - 1]), int(ends[place + 1]))
        refined = _distances_before_and_after(counts, black, row)
        if refined is not None:
            rows.append((_total_distance(refined, row), row))
    if not rows:
        return None
    cost, row = min(rows)
    if single_pair is not None and cost > max_ratio * float(
        _distance_from_level(counts, black, single_pair).sum()
    ):
        return None
    return row


def _distances_before_and_after(counts: Array, black: Flags | None, row: int) -> tuple[Array, Array] | None:
    """Distances of all readings from the levels before the row, and from those after it; None unless both
    surfaces are seen on either side."""
    parts = slice(row), slice(row, None)
    pairs = [level_pair(counts[each], None if black is None else black[each]) for each in parts]
    if pairs[0] is None or pairs[1] is None:
        return None
    return _distance_from_level(counts, black, pairs[0]), _distance_from_level(counts, black, pairs[1])


def _total_distance(distances: tuple[Array, Array], row: int) -> float:
    """Sum of the readings' distances from their levels, counts, for a step at this row."""
    return float(distances[0][:row].sum() + distances[1][row:].sum())


def _refine_step_row(distances: tuple[Array, Array], row: int, first: int, last: int) -> int:
    """The row from `first` to `last` at which a step between the levels found at `row` fits best."""
    # Readings on an edge are far from the levels, and may happen to be near those on the other side.
    max_distance = MAX_DISTANCE_RATIO * float(np.median(np.append(distances[0][:row], distances[1][row:])))
    sooner, later = (np.minimum(each[first:last], max_distance) for each in distances)
    return min(first + 1 + int(np.argmin(np.cumsum(sooner - later))), len(distances[0]) - 1)


def _distance_from_level(counts: Array, black: Flags | None, pair: tuple[float, float]) -> Array:
    """Distance of each reading, counts, from the level of its surface, or without labels from the nearer
    one."""
    white, dark = np.abs(counts - pair[0]), np.abs(counts - pair[1])
    return np.minimum(white, dark) if black is None else np.where(black, dark, white)
