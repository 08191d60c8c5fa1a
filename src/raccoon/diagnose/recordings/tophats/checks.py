"""Checks of a tophat's readings and labels: impossible counts, other units, wrong labels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.recordings.tophats.fit import MAX_MISFIT, LevelFit, NominalSensor, fit_levels
from raccoon.diagnose.recordings.tophats.levels import SurfaceLevels, sort_levels
from raccoon.diagnose.result import SensorFault
from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

MAX_SWAPPED_AGREEMENT = 0.1
"""Share of readings that agree with their labels below which black and white are exchanged."""
MAX_VOLTS = 5.5
"""Largest reading that may be in volts, or a share of the range."""


@dataclass(frozen=True, slots=True)
class ReadingScale:
    """A scale other than counts of 12 bits. counts_per_step: counts of one of its steps. max_reading: its
    largest reading."""

    words: str
    counts_per_step: float
    max_reading: float


FEWER_BITS = (
    ReadingScale("readings of 10 bits (0..1023)", 4.0, 1023.0),
    ReadingScale("readings of 8 bits (0..255)", 16.0, 255.0),
)
"""The scales of KIPR's analog10() and analog8()."""
SCALES = (*FEWER_BITS, ReadingScale("percent", (FULL_SCALE + 1.0) / 100.0, 100.0))


def without_impossible_counts(counts: Array, port: int) -> tuple[Array, tuple[SensorFault, ...]]:
    """The readings with NaN in place of values that the converter cannot give, and the fault."""
    impossible = (counts < 0.0) | (counts > FULL_SCALE)
    if not impossible.any():
        return counts, ()
    name = f"analog.{port}"
    example = f"{float(counts[impossible][0]):.3g}"
    text = f"{name} has {int(impossible.sum())} impossible values such as {example}: left out"
    return np.where(impossible, np.nan, counts), (SensorFault(name, "impossible", text),)


def describe_wrong_labels(time: Array, counts: Array, surface: Array | None, port: int) -> str:
    """Text on labels that belong to something else or to another time: the readings alone separate white from
    black, and the labels do not. "" otherwise, and if the labels are swapped."""
    by_readings = "" if surface is None else sort_levels(time, counts, None)
    if surface is None or isinstance(by_readings, str) or not by_readings.is_sorting_certain:
        return ""
    agreement = float((by_readings.black == (surface[np.searchsorted(time, by_readings.time)] > 0.5)).mean())
    if agreement < MAX_SWAPPED_AGREEMENT:
        return ""
    white, dark = by_readings.medians
    return (
        f"its own readings go from white ({white:.0f}) to black ({dark:.0f} counts) and back, but "
        f"truth.surface.{port} is of something else or of another time: by it"
    )


def describe_other_unit(counts: Array, levels: SurfaceLevels | str, nominal: NominalSensor) -> str:
    """Text on the scale of the readings if they are no counts of 12 bits; "" if they are.

    levels: of the readings, or the reason for having none.
    """
    known = counts[np.isfinite(counts)]
    if len(known) and float(known.max()) <= MAX_VOLTS and not np.all(known == np.rint(known)):
        return (
            f"it reaches {float(known.max()):.3g}, with fractions: it looks like volts or shares of the "
            "largest reading, not counts of 12 bits (0..4095)"
        )
    if isinstance(levels, str):
        return ""
    # KIPR's analog10() and analog8() give the assumed levels in fewer bits.
    scale = find_scale(levels, nominal, SCALES, lambda found: found[0].misfit <= MAX_MISFIT)
    if scale is None:
        return ""
    return (
        f"white ({levels.medians[0]:.0f}) and black ({levels.medians[1]:.0f}) are the usual counts divided "
        f"by {scale.counts_per_step:g}: it looks like {scale.words}, not counts of 12 bits (0..4095)"
    )


def find_scale(
    levels: SurfaceLevels,
    nominal: NominalSensor,
    scales: Sequence[ReadingScale],
    is_good: Callable[[list[LevelFit]], bool],
) -> ReadingScale | None:
    """The first of these scales that the levels may have, or None. is_good: decides on the fits in a
    scale."""
    if levels.clipped != (0, 0):
        return None
    table = levels.surface_levels(np.ones(len(levels.time), np.bool_))
    for each in scales:
        scaled = table * np.array([1.0, each.counts_per_step, each.counts_per_step])
        if levels.counts.max() <= each.max_reading and is_good(fit_levels(scaled, nominal)):
            return each
    return None
