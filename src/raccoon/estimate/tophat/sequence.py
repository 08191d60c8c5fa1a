"""What the order of the readings tells: edges being crossed, spikes, drift, and whether there is an order.

A line is entered within a few readings and stays for a few; a spike is alone; a drift takes its time; a
shuffled sample has no order at all.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEEP_SDS = 5.0  # noise standard deviations between the means of three readings before and three after
BETWEEN_SHARE = 0.25  # of the way from before to after, from both ends
LONE_SDS = 8.0  # noise standard deviations between a reading and its neighbours
MAX_LONE_SHARE = 0.5  # share of those readings that may be alone
READINGS_PER_RUN = 6  # readings in a row, on the average, that a surface under a driving robot gives
NOISE_SHARE = 15.0  # a fifteenth of the contrast may be left of the noise
QUICK_READINGS, QUICK_SHARE = 10, 0.03  # an edge takes at most this many readings, or this share of the drive
TREND_POINTS, TREND_WINDOW = 20, 0.2  # of the running median; a line is much narrower than the window


def noise_sd(counts: Array) -> float:
    """Counts: sd of the noise from reading to reading, from the median of the second differences.

    A second difference of independent readings has the variance 6 sd^2; the median does not see edges.
    """
    second = counts[2:] - 2.0 * counts[1:-1] + counts[:-2]
    return max(1.0, float(np.median(np.abs(second))) / (0.6745 * math.sqrt(6.0)))


def settled_mask(counts: Array, *, ends: bool = False) -> Mask:
    """False where an edge is being crossed, shape (n,).

    There the readings before and after differ by more than noise and this one lies between them. A reading on
    the last of a line does not, and hardly any reading of a shuffled sample does. ends: whether the first and
    last of an edge count as well, all that is more than noise; a narrow line may be nothing else.
    """
    threes = np.convolve(counts, np.ones(3) / 3.0, mode="valid")  # threes[i] is the mean of i, i+1, i+2
    before, after, here = threes[:-4], threes[4:], counts[3:-3]
    rise, noise = after - before, noise_sd(counts)
    steep = np.abs(rise) > STEEP_SDS * math.sqrt(2.0 / 3.0) * noise
    way = np.where(rise == 0.0, 1.0, rise)
    share = (here - before) / way
    least = np.minimum(BETWEEN_SHARE, STEEP_SDS * noise / np.abs(way)) if ends else BETWEEN_SHARE
    calm = np.ones(len(counts), dtype=bool)
    calm[3:-3] = ~(steep & (share > least) & (share < 1.0 - least))
    return calm


def spike_mask(counts: Array) -> Mask:
    """True where a single reading differs from both sides of it, shape (n,)."""
    limit = LONE_SDS * noise_sd(counts)
    away = np.abs(np.diff(counts)) > limit
    lone = np.zeros(len(counts), dtype=bool)
    lone[1:-1] = away[1:] & away[:-1] & (np.abs(counts[2:] - counts[:-2]) <= limit)
    return lone


def count_runs(mask: Mask) -> int:
    """How many unbroken runs of True there are."""
    return int(mask[0]) + int(np.count_nonzero(mask[1:] & ~mask[:-1]))


def comes_in_runs(counts: Array, cut: float) -> bool:
    """True where the readings above `cut` come in rows, as a surface that is driven over gives them.

    Judged on medians of three: lone readings beyond the cut, which noise makes on either side, do not count.
    """
    raw = counts > cut
    above = (raw[2:].astype(int) + raw[1:-1] + raw[:-2]) >= 2
    if abs(np.count_nonzero(above) - np.count_nonzero(raw)) > MAX_LONE_SHARE * np.count_nonzero(raw):
        return False
    rarer = int(min(np.count_nonzero(above), np.count_nonzero(~above)))
    return 0 < count_runs(above) <= max(1, rarer // READINGS_PER_RUN)


def has_quick_edge(counts: Array, bright: float, dark: float) -> bool:
    """True where some passage between the two levels takes no longer than an edge does.

    Timed from 30 to 70 % of the way, on a mean over as many readings as keep noise from shortening it.
    """
    width = min(max(3, math.ceil((NOISE_SHARE * noise_sd(counts) / (dark - bright)) ** 2)), 25)
    level = (np.convolve(counts, np.ones(width) / width, mode="valid") - bright) / (dark - bright)
    side = np.where(level >= 0.7, 1, np.where(level <= 0.3, -1, 0))
    known = np.flatnonzero(side)
    crossing = side[known[1:]] != side[known[:-1]]
    if not crossing.any():
        return False
    quickest = int(np.min(np.diff(known)[crossing].astype(np.int64)))
    return quickest <= max(QUICK_READINGS, QUICK_SHARE * len(counts)) + width


def running_trend(counts: Array) -> tuple[Array, slice]:
    """The slow part of the readings, shape (n,): a running median over a fifth of the drive.

    And the part of the drive where it is known: half a window from each end the median has no other side.
    """
    n = len(counts)
    half = max(int(0.5 * TREND_WINDOW * n), 1)
    centres = np.linspace(half, n - 1 - half, TREND_POINTS).astype(int)
    medians = [float(np.median(counts[centre - half : centre + half + 1])) for centre in centres]
    return np.interp(np.arange(n), centres, medians), slice(half, n - half)


def longest_above(counts: Array, cut: float, ways: Array) -> float:
    """m: the longest way over which the readings stay at `cut` or above. ways: m to each, shape (n,); NaN at
    the first of another drive."""
    above, seams = counts >= cut, np.isnan(ways)
    if not above.any():
        return 0.0
    starts = np.flatnonzero(above & (seams | ~np.concatenate([[False], above[:-1]])))
    return float(np.add.reduceat(np.where(above & ~seams, ways, 0.0), starts).max())
