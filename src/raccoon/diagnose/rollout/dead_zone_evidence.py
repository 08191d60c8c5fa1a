"""Evidence of dead zones from the histograms of the readings: wheels whose small readings are missing.

A fit only compares the speed while a reading was 0, and does not notice that readings of 1 or 2 counts never
occur. On a robot whose wheels both read 0 below 3.2 counts, one wheel was named.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.truncation import HALF_A_COUNT
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

ZONE = "bemf.dead_zone"
MAX_SHARE_IN_GAP = 0.1
"""Share of the expected readings below a size up to which there is a gap."""
MIN_SHARE_HEARD = 0.5
"""Share of the expected readings below a size from which a wheel has small readings as usual."""
LIFTED_SHARE = 0.05
"""Share of the readings in a zone that noise lifts out of it."""
MIN_EXPECTED_READINGS = 20.0
"""Number of expected readings below a size, fewer than which a histogram is not used."""
SAME_GAP_TOLERANCE = 0.2
"""Difference of two wheels' gaps, relative to the narrower one and in addition to one count, up to which they
may be one zone."""
MIN_SIZES_NEAR_EDGE = 5
"""Number of sizes of readings, from the smallest to twice that, fewer than which the smallest does not show
where a zone ends: it may be a stray one."""
MAX_ZONE_COUNTS = 200
"""Counts. A wider gap is no dead zone."""
MAX_GAP_EVIDENCE = 40.0
"""Upper bound on the log evidence of a gap: with that a zone is certain, whatever the rest of the data."""


@dataclass(frozen=True, slots=True)
class ReadingEvidence:
    """What the readings themselves, without any simulation, show of a cause.

    log_evidence: of the cause, where its first coordinate is at least `least`. low, std: lower bound of that
    coordinate, and its standard deviation by the readings alone; infinite if they do not show its size.
    """

    log_evidence: float
    least: float
    low: float = -math.inf
    std: float = math.inf


@dataclass(frozen=True, slots=True)
class ReadingGaps:
    """Gaps in the readings of both wheels. histograms: number of readings by size. widths: of the gaps in
    counts, 0 if there is none or too few readings."""

    histograms: Mapping[str, Array]
    widths: Mapping[str, int]

    @classmethod
    def of(cls, log: Log) -> ReadingGaps:
        """The gaps of a log's readings."""
        histograms = {side: _histogram(log, side) for side in SIDES}
        return cls(histograms, {side: find_gap(each) for side, each in histograms.items()})

    def places(self) -> tuple[str | None, ...]:
        """Possible places of a dead zone: both wheels (None), or one."""
        wide = [side for side in SIDES if self.widths[side]]
        if len(wide) == len(SIDES):
            narrow, other = sorted(self.widths.values())
            return (None,) if other - narrow <= 1.0 + SAME_GAP_TOLERANCE * narrow else SIDES
        if not wide:
            return (None, *SIDES)
        other_hears = _share_below(self.histograms[_other(wide[0])], self.widths[wide[0]]) > MIN_SHARE_HEARD
        return (wide[0],) if other_hears else (None, wide[0])

    def evidence(self, place: str | None) -> float:
        """Log evidence of a dead zone at one of the places, from the readings missing there. It is reduced
        equally for all places such that the best has at most `MAX_GAP_EVIDENCE`."""
        best = max(self._missing(each) for each in self.places())
        return self._missing(place) - max(best - MAX_GAP_EVIDENCE, 0.0)

    def _missing(self, place: str | None) -> float:
        widest = max(self.widths.values())
        sides = {side: self.widths[side] or widest for side in (SIDES if place is None else (place,))}
        return sum(_missing_evidence(self.histograms[side], each) for side, each in sides.items())

    def least(self, place: str | None) -> float:
        """Smallest zone in counts that explains the gap there: half the gap's width."""
        sides = SIDES if place is None else (place,)
        return 0.5 * min((self.widths[side] for side in sides if self.widths[side]), default=0)

    def width(self, place: str | None) -> tuple[float, float]:
        """Width of a zone in counts and its standard deviation, by the smallest reading that is not 0; 0 and
        infinite if there are too few readings near it.

        The readings just outside a zone have random sizes. With n per count the smallest is on average 1 / n
        counts outside, with a standard deviation of as much (exponential distribution). Each size is counted
        once, since a robot that keeps its speed repeats one. Truncation makes readings half a count smaller
        on average.
        """
        sizes = [
            np.flatnonzero(self.histograms[side][1:]) + 1 for side in (SIDES if place is None else (place,))
        ]
        least = min((int(each[0]) for each in sizes if len(each)), default=0)
        near = sum(int((each < 2 * least).sum()) for each in sizes)
        if near < MIN_SIZES_NEAR_EDGE:
            return 0.0, math.inf
        std = max(least / near, HALF_A_COUNT)
        return least + HALF_A_COUNT - std, std


def without_ruled_out_zones(causes: Sequence[Cause], log: Log) -> tuple[Cause, ...]:
    """The causes without the dead zones that contradict the readings: of one wheel if both lack the same
    small readings, and of a wheel that has them."""
    places = ReadingGaps.of(log).places()
    return tuple(each for each in causes if each.id != ZONE or each.where in places)


def dead_zone_evidence(causes: Mapping[str, Cause], log: Log) -> dict[str, ReadingEvidence]:
    """What the readings show of each dead zone: log evidence from a gap, which counts from half the gap's
    width on, and the zone's width. The width is only used if the simulation has no zone yet."""
    gaps = ReadingGaps.of(log)
    found = [each for each in causes.values() if each.id == ZONE and each.where in gaps.places()]
    shown = {}
    for each in found:
        unit = each.coordinates[0].value(1.0)
        evidence = gaps.evidence(each.where) if any(gaps.widths.values()) else 0.0
        width, std = gaps.width(each.where)
        bounds = (width / unit, std / unit) if each.one_sided else ()
        shown[each.name] = ReadingEvidence(evidence, gaps.least(each.where) / unit, *bounds)
    return shown


def _other(side: str) -> str:
    return SIDES[1 - SIDES.index(side)]


def find_gap(histogram: Array) -> int:
    """The largest size in counts below which nearly no readings except 0 occur, although many occur from
    there to twice that size; 0 if there is no such gap."""
    total = np.concatenate([[0.0], np.cumsum(histogram)])
    widths = np.arange(2, len(histogram) // 2)
    # At least three quarters of the numbers are at or above their lower quartile, so few widths need the
    # exact test.
    most = (widths - 1) * (total[2 * widths + 2] - total[widths]) / (widths + 2) / 0.75
    near = widths[(total[widths] - total[1] <= MAX_SHARE_IN_GAP * most) & (most >= MIN_EXPECTED_READINGS)]
    return max(
        (int(width) for width in near if _share_below(histogram, int(width)) <= MAX_SHARE_IN_GAP), default=0
    )


def _histogram(log: Log, side: str) -> Array:
    """Number of readings of each size in counts, from 0 on."""
    channel = log.channel(f"bemf_{side}")
    if channel is None:
        return np.zeros(2 * MAX_ZONE_COUNTS)
    sizes = np.abs(channel.values[np.isfinite(channel.values)])
    return np.asarray(
        np.bincount(np.minimum(sizes, 2.0 * MAX_ZONE_COUNTS).astype(int), minlength=2 * MAX_ZONE_COUNTS),
        float,
    )


def _expected_below(histogram: Array, width: int) -> float:
    """Expected number of readings below a size, without those of 0, from the lower quartile of the counts
    just above it."""
    return (width - 1) * float(np.quantile(histogram[width : 2 * width + 2], 0.25))


def _share_below(histogram: Array, width: int) -> float:
    """Number of readings below a size, without those of 0, relative to the expected number; NaN if too few
    are expected."""
    expected = _expected_below(histogram, width)
    return float(histogram[1:width].sum()) / expected if expected >= MIN_EXPECTED_READINGS else math.nan


def _missing_evidence(histogram: Array, width: int) -> float:
    """Log evidence (Poisson) for a zone that passes LIFTED_SHARE of the expected readings below a size,
    against no zone."""
    expected, heard = _expected_below(histogram, width), float(histogram[1:width].sum())
    return (1.0 - LIFTED_SHARE) * expected + heard * math.log(LIFTED_SHARE)
