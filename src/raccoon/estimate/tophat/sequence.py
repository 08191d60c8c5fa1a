"""Detection of edges, spikes, drift and order in a sequence of readings.

A line is entered within a few readings and stays for a few; a spike is a single reading; a drift is slow; a
shuffled sample has no order.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEEP_SDS = 5.0  # noise standard deviations between the means of three readings before and after
BETWEEN_SHARE = 0.25  # distance from both ends, as a share of the step from before to after
LONE_SDS = 8.0  # noise standard deviations between a reading and its neighbours
MAX_LONE_SHARE = 0.5  # share of those readings that may be single
READINGS_PER_RUN = 6  # mean number of readings in a row on a surface under a driving robot
NOISE_SHARE = 15.0  # contrast over the noise that may remain
QUICK_READINGS, QUICK_SHARE = 10, 0.03  # most readings of an edge, or share of the drive
# of the running median: points, and window as a share of the drive; lines are narrower
TREND_POINTS, TREND_WINDOW = 20, 0.2


def noise_sd(counts: Array) -> float:
    """Standard deviation (counts) of the noise between readings, from the median of the second differences.

    A second difference of independent readings has the variance 6 sd^2; the median ignores edges.
    """
    second = counts[2:] - 2.0 * counts[1:-1] + counts[:-2]
    return max(1.0, float(np.median(np.abs(second))) / (0.6745 * math.sqrt(6.0)))


def settled_mask(counts: Array, *, ends: bool = False) -> Mask:
    """False for readings on an edge, shape (n,).

    There the readings before and after differ by more than noise, and this one is between them. The last
    reading on a line is not, and hardly any of a shuffled sample. ends: whether the first and last readings
    of an edge count, too, with anything above noise; a narrow line may consist of them.
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
    """True for a single reading that differs from both neighbours, shape (n,)."""
    limit = LONE_SDS * noise_sd(counts)
    away = np.abs(np.diff(counts)) > limit
    lone = np.zeros(len(counts), dtype=bool)
    lone[1:-1] = away[1:] & away[:-1] & (np.abs(counts[2:] - counts[:-2]) <= limit)
    return lone


def count_runs(mask: Mask) -> int:
    """Number of unbroken runs of True."""
    return int(mask[0]) + int(np.count_nonzero(mask[1:] & ~mask[:-1]))


def comes_in_runs(counts: Array, cut: float) -> bool:
    """Whether the readings above `cut` come in runs, as those over a surface do in a drive.

    Judged on medians of three: single readings beyond the cut, which noise makes on either side, do not
    count.
    """
    raw = counts > cut
    above = (raw[2:].astype(int) + raw[1:-1] + raw[:-2]) >= 2
    if abs(np.count_nonzero(above) - np.count_nonzero(raw)) > MAX_LONE_SHARE * np.count_nonzero(raw):
        return False
    rarer = int(min(np.count_nonzero(above), np.count_nonzero(~above)))
    return 0 < count_runs(above) <= max(1, rarer // READINGS_PER_RUN)


def has_quick_edge(counts: Array, bright: float, dark: float) -> bool:
    """Whether some passage between the two levels is as short as an edge.

    Timed from 30 to 70 % of the step, on a mean over enough readings that noise does not shorten it.
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

    And the part of the drive in which it is valid: within half a window of each end the median is one-sided.
    """
    n = len(counts)
    half = max(int(0.5 * TREND_WINDOW * n), 1)
    centres = np.linspace(half, n - 1 - half, TREND_POINTS).astype(int)
    medians = [float(np.median(counts[centre - half : centre + half + 1])) for centre in centres]
    return np.interp(np.arange(n), centres, medians), slice(half, n - half)


def longest_above(counts: Array, cut: float, ways: Array) -> float:
    """The longest distance (m) over which the readings stay at `cut` or above. ways: m to each reading, shape
    (n,); NaN at the first one of another drive."""
    above, seams = counts >= cut, np.isnan(ways)
    if not above.any():
        return 0.0
    starts = np.flatnonzero(above & (seams | ~np.concatenate([[False], above[:-1]])))
    return float(np.add.reduceat(np.where(above & ~seams, ways, 0.0), starts).max())
