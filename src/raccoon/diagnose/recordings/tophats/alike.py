"""What else two levels may be, beside what is named: other causes, another make of sensor, other counts."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.diagnose.recordings.tophats.checks import FEWER_BITS, Scale, scale_of
from raccoon.diagnose.recordings.tophats.fit import FITS, OLDER, WIDTHS, LevelFit, Nominal
from raccoon.diagnose.recordings.tophats.levels import Levels
from raccoon.diagnose.recordings.tophats.words import HEIGHT, bits_note, older_too_note

TIE = 3.0
"""Cost by which another fit may be above the best one and do about as well."""
MOUNTED = (0.003, 0.025)
"""m above the floor between which sensors are mounted."""


def rivals_of(fits: Sequence[LevelFit], best: LevelFit, id_: str, whole: int) -> tuple[str, ...]:
    """Causes of other fits that do about as well without this one. Where one level is left, and where the
    numbers of the causes are not what was fitted, all that fit the levels are listed. Two numbers give any
    two levels: beside what was fitted anything else is listed."""
    if best.numbers > 1:
        return tuple(sorted(set(WIDTHS) - set(best.ids)))
    loose = whole < 2 or not best.exact
    found = {
        name
        for each in fits
        if each.cost < best.cost + TIE or (loose and each.misfit <= FITS)
        if id_ not in each.ids
        for name in each.ids
        if name not in best.ids
    }
    return tuple(sorted(found))


def also_so(
    port: int, levels: Levels, nominal: Nominal, fits: Sequence[LevelFit], best: LevelFit
) -> tuple[str, ...]:
    """Notes on an older sensor or counts of fewer bits that would read the same as what is named."""
    notes = []
    older = [each for each in fits if each.generation == OLDER and each.numbers == 2 and each.misfit <= FITS]
    at = [nominal.height + float(each.values[each.ids.index(HEIGHT)]) for each in older if HEIGHT in each.ids]
    if best.ids == (HEIGHT,) and any(MOUNTED[0] <= each <= MOUNTED[1] for each in at):
        notes.append(older_too_note(port, at[0]))
    if best.ids and (scale := _fewer_bits(levels, nominal, best)) is not None:
        notes.append(bits_note(port, scale.words, scale.counts))
    return tuple(notes)


def _fewer_bits(levels: Levels, nominal: Nominal, best: LevelFit) -> Scale | None:
    """Counts of fewer bits, of which one cause explains the levels at less cost than what is named does."""

    def better(found: list[LevelFit]) -> bool:
        return any(one.numbers < 2 and one.misfit <= FITS and one.cost < best.cost for one in found)

    return scale_of(levels, nominal, FEWER_BITS, better)
