"""Alternative explanations of the two levels: other causes, another make of sensor, counts of fewer bits."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.diagnose.recordings.tophats.checks import FEWER_BITS, ReadingScale, find_scale
from raccoon.diagnose.recordings.tophats.fit import (
    CHANGE_WIDTHS,
    MAX_MISFIT,
    OLDER_GENERATION,
    LevelFit,
    NominalSensor,
)
from raccoon.diagnose.recordings.tophats.levels import SurfaceLevels
from raccoon.diagnose.recordings.tophats.sentences import (
    HEIGHT,
    describe_fewer_bits,
    describe_older_alternative,
)

MAX_TIE_COST = 3.0
"""Cost above the best fit's up to which another fit counts as equally good."""
MOUNTING_HEIGHTS_M = (0.003, 0.025)
"""Lowest and highest mounting height of a sensor above the floor, m."""


def find_rivals(fits: Sequence[LevelFit], best: LevelFit, id_: str, levels_read: int) -> tuple[str, ...]:
    """Causes of other, equally good fits without this cause. If only one level is left, or the causes' values
    approximate what was fitted, these are all causes that fit the levels. Two parameters fit any two levels,
    so the rivals of a pair are all other causes. levels_read: number of levels that are not clipped."""
    if best.parameter_count > 1:
        return tuple(sorted(set(CHANGE_WIDTHS) - set(best.ids)))
    is_ambiguous = levels_read < 2 or not best.is_exact
    found = {
        name
        for each in fits
        if each.cost < best.cost + MAX_TIE_COST or (is_ambiguous and each.misfit <= MAX_MISFIT)
        if id_ not in each.ids
        for name in each.ids
        if name not in best.ids
    }
    return tuple(sorted(found))


def alternative_notes(
    port: int, levels: SurfaceLevels, nominal: NominalSensor, fits: Sequence[LevelFit], best: LevelFit
) -> tuple[str, ...]:
    """Notes on an older sensor or counts of fewer bits that would give the same readings as the named
    cause."""
    notes = []
    older = [
        each
        for each in fits
        if each.generation == OLDER_GENERATION and each.parameter_count == 2 and each.misfit <= MAX_MISFIT
    ]
    heights = [
        nominal.height + float(each.values[each.ids.index(HEIGHT)]) for each in older if HEIGHT in each.ids
    ]
    if best.ids == (HEIGHT,) and any(
        MOUNTING_HEIGHTS_M[0] <= each <= MOUNTING_HEIGHTS_M[1] for each in heights
    ):
        notes.append(describe_older_alternative(port, heights[0]))
    if best.ids and (scale := _find_fewer_bits(levels, nominal, best)) is not None:
        notes.append(describe_fewer_bits(port, scale.words, scale.counts_per_step))
    return tuple(notes)


def _find_fewer_bits(levels: SurfaceLevels, nominal: NominalSensor, best: LevelFit) -> ReadingScale | None:
    """A scale of fewer bits on which a single cause explains the levels at a lower cost than the best fit, or
    None."""

    def is_better(found: list[LevelFit]) -> bool:
        return any(
            one.parameter_count < 2 and one.misfit <= MAX_MISFIT and one.cost < best.cost for one in found
        )

    return find_scale(levels, nominal, FEWER_BITS, is_better)
