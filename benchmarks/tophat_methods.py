"""Other ways to a threshold, for comparison (see tophat.py). None of them can say no, but one.

`midpoint` and `RunningMidpoint` are the paper's start-up and on-the-fly methods; `percentile` and `trimmed`
are those that the clustering literature compares k-means with (92, 98 and 100 % success); `k_means` is
clustering as it is commonly done, with the acceptance rule of the robots' present library.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from raccoon.core.errors import CalibrationError
from raccoon.estimate.tophat.quality import check_counts

FIXED = 1500.0  # counts
MIN_RANGE, MIN_CONTRAST = 500.0, 700.0  # counts, that the present library demands


def fixed(samples: ArrayLike) -> float:
    """Counts: always 1500, whatever the samples."""
    check_counts(samples)
    return FIXED


def midpoint(samples: ArrayLike) -> float:
    """Counts: halfway between the lowest and the highest reading at start-up."""
    counts = _some(samples)
    return 0.5 * float(counts.min() + counts.max())


def percentile(samples: ArrayLike) -> float:
    """Counts: halfway between the 10th and the 90th percentile."""
    low, high = np.percentile(_some(samples), (10.0, 90.0))
    return 0.5 * float(low + high)


def trimmed(samples: ArrayLike) -> float:
    """Counts: the median of the readings within the middle 80 % of their range."""
    counts = _some(samples)
    low, high = float(counts.min()), float(counts.max())
    inside = counts[(counts >= low + 0.1 * (high - low)) & (counts <= high - 0.1 * (high - low))]
    return float(np.median(inside if len(inside) else counts))


def k_means(samples: ArrayLike) -> float:
    """Counts: halfway between the two centres of k-means (scikit-learn).

    Raises CalibrationError where the range is under 500 or the centres are under 700 counts apart.
    """
    from sklearn.cluster import KMeans

    counts = _some(samples)
    if float(np.ptp(counts)) < MIN_RANGE:
        raise CalibrationError(f"range {np.ptp(counts):.0f} counts: at least {MIN_RANGE:.0f} are demanded")
    centres = np.sort(KMeans(2, n_init=1, random_state=0).fit(counts[:, np.newaxis]).cluster_centers_.ravel())
    if centres[1] - centres[0] < MIN_CONTRAST:
        raise CalibrationError(
            f"contrast {centres[1] - centres[0]:.0f} counts: at least {MIN_CONTRAST:.0f} are demanded"
        )
    return 0.5 * float(centres[0] + centres[1])


METHODS: Mapping[str, Callable[[ArrayLike], float]] = {
    "fixed": fixed,
    "midpoint": midpoint,
    "percentile": percentile,
    "trimmed": trimmed,
    "k_means": k_means,
}
"""Threshold methods by name; each takes samples and returns counts."""


class RunningMidpoint:
    """The paper's on-the-fly method: the middle of the highest and lowest reading lately.

    memory: readings in which both ends close in on each other by two thirds, so that old light is forgotten.
    least_range: counts, below which there is no threshold (None), as long as no variation has been seen.
    """

    def __init__(self, *, memory: float = 600.0, least_range: float = 40.0) -> None:
        self._share = 1.0 / memory
        self._least = least_range
        self.low = self.high = float("nan")

    @property
    def threshold(self) -> float | None:
        """Counts, or None where white and black have not both been seen."""
        return 0.5 * (self.low + self.high) if self.high - self.low >= self._least else None

    def update(self, counts: float) -> bool | None:
        """Take a reading; whether it is black, None while that cannot be said."""
        if not self.low <= self.high:
            self.low = self.high = counts
        closing = self._share * (self.high - self.low)
        self.low = min(self.low + closing, counts)
        self.high = max(self.high - closing, counts)
        threshold = self.threshold
        return None if threshold is None else counts >= threshold


def _some(samples: ArrayLike) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    counts = check_counts(samples)
    if len(counts) < 2:
        raise CalibrationError(f"{len(counts)} readings: at least 2 are needed")
    return counts
