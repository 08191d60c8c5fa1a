"""Readings of a tophat that are none of a converter's counts, and labels that are not theirs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.fit import FITS, LevelFit, Nominal, level_fits
from raccoon.diagnose.recordings.tophats.levels import Levels, levels_of
from raccoon.diagnose.result import SensorFault
from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

SWAPPED = 0.1
"""Share of readings on the surface that their label says, below which black and white are exchanged."""
MOST_VOLTS = 5.5
"""What volts of a board, or shares of its range, reach at most."""


@dataclass(frozen=True, slots=True)
class Scale:
    """Another scale than counts of 12 bits. counts: that one step of it is. most: its largest reading."""

    words: str
    counts: float
    most: float


FEWER_BITS = (
    Scale("readings of 10 bits (0..1023)", 4.0, 1023.0),
    Scale("readings of 8 bits (0..255)", 16.0, 255.0),
)
"""KIPR's analog10() and analog8()."""
SCALES = (*FEWER_BITS, Scale("percent", (FULL_SCALE + 1.0) / 100.0, 100.0))


def possible(counts: Array, port: int) -> tuple[Array, tuple[SensorFault, ...]]:
    """Readings that the converter can give, NaN for the others, and what is said of those."""
    wild = (counts < 0.0) | (counts > FULL_SCALE)
    if not wild.any():
        return counts, ()
    name = f"analog.{port}"
    text = f"{name} has {int(wild.sum())} impossible values such as {float(counts[wild][0]):.3g}: left out"
    return np.where(wild, np.nan, counts), (SensorFault(name, "impossible", text),)


def strange_labels(time: Array, counts: Array, surface: Array | None, port: int) -> str:
    """That labels by which nothing can be told are not this sensor's, or not in time, where its readings
    alone tell white from black; "" where they do not, and of labels that are swapped."""
    alone = "" if surface is None else levels_of(time, counts, None)
    if surface is None or isinstance(alone, str) or not alone.sorted_surely:
        return ""
    agree = float((alone.black == (surface[np.searchsorted(time, alone.time)] > 0.5)).mean())
    if agree < SWAPPED:
        return ""
    white, dark = alone.usual
    return (
        f"its own readings go from white ({white:.0f}) to black ({dark:.0f} counts) and back, and "
        f"truth.surface.{port} is of something else or of another time, since by it"
    )


def other_unit(counts: Array, levels: Levels | str, nominal: Nominal) -> str:
    """What readings seem to be that are no counts of the converter; "" where they are.

    levels: of the readings, or why there are none, as of all that are small.
    """
    known = counts[np.isfinite(counts)]
    if len(known) and float(known.max()) <= MOST_VOLTS and not np.all(known == np.rint(known)):
        return (
            f"it reaches {float(known.max()):.3g}, in parts: it looks like volts or shares of the largest "
            "reading, not counts of 12 bits (0..4095)"
        )
    if isinstance(levels, str):
        return ""
    # Of fewer bits as assumed are the levels of KIPR's analog10() and analog8().
    scale = scale_of(levels, nominal, SCALES, lambda found: found[0].misfit <= FITS)
    if scale is None:
        return ""
    return (
        f"white ({levels.usual[0]:.0f}) and black ({levels.usual[1]:.0f}) are the usual counts over "
        f"{scale.counts:g}: it looks like {scale.words}, not counts of 12 bits (0..4095)"
    )


def scale_of(
    levels: Levels, nominal: Nominal, scales: Sequence[Scale], fits: Callable[[list[LevelFit]], bool]
) -> Scale | None:
    """The first of these scales on which the levels may be. fits: whether what is fitted on one is good."""
    if levels.cut != (0, 0):
        return None
    table = levels.both(np.ones(len(levels.time), np.bool_))
    for each in scales:
        counted = table * np.array([1.0, each.counts, each.counts])
        if levels.counts.max() <= each.most and fits(level_fits(counted, nominal)):
            return each
    return None
