"""Which wheels' small readings are missing: what a histogram says of dead zones and a simulation does not.

A fit sees where the speed was while a reading was 0, and no more: that no reading of 1 or 2 counts ever came
is nothing to it. Of a robot whose wheels both were deaf below 3.2 counts one wheel was named.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.hypotheses import Cause
from raccoon.diagnose.log import Log
from raccoon.sim.parameters import SIDES

Array = NDArray[np.float64]

ZONE = "bemf.dead_zone"
SILENT = 0.1
"""Part of the readings that are to be expected below a gap, up to which it is one."""
HEARS = 0.5
"""The same from which a wheel has small readings like any other."""
FEWEST = 20.0
"""Readings that are to be expected there, below which a histogram says nothing."""
ALIKE = 0.2
"""Part of it, or that many counts and one, by which two wheels' gaps may differ and be one zone."""
WIDEST = 200
"""Counts: what is silent up to more is no dead zone."""
MOST = 40.0
"""Log evidence that a gap has at most: it is sure then, and need not help elsewhere."""


def asked_for(causes: Sequence[Cause], log: Log) -> tuple[Cause, ...]:
    """The causes without those dead zones that the readings themselves rule out: of one wheel where both miss
    the same small readings, and of a wheel that has them."""
    histograms = {side: _histogram(log, side) for side in SIDES}
    gaps = {side: gap(each) for side, each in histograms.items()}
    wrong: set[str] = set()
    if all(gaps.values()):
        wrong |= {f"{ZONE}@{each}" for each in SIDES} if _alike(gaps) else {ZONE}
    for side, other in (SIDES, SIDES[::-1]):
        if gaps[side] and not gaps[other] and _heard_below(histograms[other], gaps[side]) > HEARS:
            wrong |= {ZONE, f"{ZONE}@{other}"}
    return tuple(each for each in causes if each.name not in wrong)


def told(causes: Mapping[str, Cause], log: Log) -> dict[str, tuple[float, float]]:
    """The dead zones that the readings show, with the log evidence of that and half of their size in widths:
    as many readings are missing as are to be expected."""
    histograms = {side: _histogram(log, side) for side in SIDES}
    gaps = {side: gap(each) for side, each in histograms.items()}
    places = [(ZONE, min(gaps.values()))] if all(gaps.values()) and _alike(gaps) else []
    places += [(f"{ZONE}@{side}", width) for side, width in gaps.items() if width]
    found = {}
    for name, width in places:
        if name in causes:
            sides = [name.partition("@")[2]] if "@" in name else SIDES
            evidence = sum(_missing(histograms[side], gaps[side]) for side in sides)
            found[name] = min(evidence, MOST), 0.5 * width / causes[name].coordinates[0].value(1.0)
    return found


def _alike(gaps: Mapping[str, int]) -> bool:
    return abs(gaps["left"] - gaps["right"]) <= 1.0 + ALIKE * min(gaps.values())


def gap(histogram: Array) -> int:
    """The largest size of a reading below which there are next to none but 0, though there are many of that
    size and up to twice it; 0 where there is no such gap."""
    total = np.concatenate([[0.0], np.cumsum(histogram)])
    widths = np.arange(2, len(histogram) // 2)
    # At least three quarters of numbers are their lower quartile or more: few widths need a closer look.
    most = (widths - 1) * (total[2 * widths + 2] - total[widths]) / (widths + 2) / 0.75
    near = (
        widths[(total[widths] - total[1] <= SILENT * most) & (most >= FEWEST)] if len(histogram) else widths
    )
    return max((int(width) for width in near if _heard_below(histogram, int(width)) <= SILENT), default=0)


def _histogram(log: Log, side: str) -> Array:
    """How often each size of a reading comes, from 0 counts on."""
    channel = log.channel(f"bemf_{side}")
    if channel is None:
        return np.zeros(0)
    sizes = np.abs(channel.values[np.isfinite(channel.values)])
    return np.asarray(np.bincount(np.minimum(sizes, 2.0 * WIDEST).astype(int), minlength=2 * WIDEST), float)


def _expected_below(histogram: Array, width: int) -> float:
    """Readings below a size that are not 0, as many as the rarer ones just above it let expect."""
    above = histogram[width : 2 * width + 2]
    return (width - 1) * float(np.quantile(above, 0.25)) if len(above) else 0.0


def _heard_below(histogram: Array, width: int) -> float:
    """What part of them there is; NaN where they are too few to expect any."""
    expected = _expected_below(histogram, width)
    return float(histogram[1:width].sum()) / expected if expected >= FEWEST else math.nan


def _missing(histogram: Array, width: int) -> float:
    """Log evidence, of counts by Poisson, that there are as few as there are rather than as expected."""
    expected, heard = _expected_below(histogram, width), float(histogram[1:width].sum())
    return expected - heard - (heard * math.log(expected / heard) if heard else 0.0)
