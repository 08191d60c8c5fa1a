"""Noise of a reflectance sensor's readings: that of the sensor, and that of the floor's pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MIN_READINGS = 8
"""Least number of readings for an estimate."""
MIN_SD = 1.0
"""Lower bound of the noise, counts: a converter's quantisation."""
MIN_PATTERN_RATIO = 1.5
"""Ratio of the floor's patterns over both surfaces above which the pattern is separable from the sensor's
noise."""
OUTLIER_SDS = 5.0
"""Step between neighbours, in standard deviations of the noise, above which it is an outlier."""
FLOOR_BRIGHTNESS_SD = 0.02
"""Relative standard deviation of a floor's brightness (`raccoon.model.reflectance.read`)."""
MAD_TO_SD = 1.4826
"""Ratio of standard deviation and median absolute deviation of a normal distribution."""


def noise_sd(steps: Array) -> float:
    """Standard deviation of a reading from the steps between neighbours, without steps at edges and
    spikes."""
    rough = max(MAD_TO_SD * float(np.median(np.abs(steps))), np.sqrt(2.0) * MIN_SD)
    inliers = steps[np.abs(steps) < OUTLIER_SDS * rough]
    return max(float(np.sqrt(np.mean(inliers**2) / 2.0)), MIN_SD)


def sensor_noise(
    steps: Array, pairs: Flags, black: Flags, medians: tuple[float, float], noise: float
) -> tuple[float, float]:
    """Standard deviation of a reading, and the part of it that may come from the floor, counts. noise: the
    result if no surface has enough readings.

    A converter's noise is equal over both surfaces; that of a floor's pattern grows with the slope of the
    reading and shows over white, and that of flickering lamps over black. So with n² = e² + g² p² over either
    surface, where p is `floor_pattern`, the noise is e; if no g solves this, it is the smaller n.
    """
    found = []
    for side in (False, True):
        mine = pairs & (black[1:] == side)
        if mine.sum() >= MIN_READINGS:
            found.append((noise_sd(steps[mine]), floor_pattern(medians[int(side)])))
    if len(found) < 2:
        return found[0] if found else (noise, max(map(floor_pattern, medians)))
    found.sort()
    (smaller_noise, smaller_pattern), (larger_noise, larger_pattern) = found
    if larger_pattern < MIN_PATTERN_RATIO * smaller_pattern:
        return smaller_noise, min(smaller_pattern, larger_pattern)
    square = (smaller_noise**2 * larger_pattern**2 - larger_noise**2 * smaller_pattern**2) / (
        larger_pattern**2 - smaller_pattern**2
    )
    return max(float(np.sqrt(max(square, 0.0))), MIN_SD), 0.0


def floor_pattern(level: float) -> float:
    """Standard deviation, counts, by the floor's varying brightness at a level: counts = 4095 / (1 + x) has
    the slope -counts (1 - counts / 4095) over the logarithm of the light x."""
    return FLOOR_BRIGHTNESS_SD * abs(level * (1.0 - level / FULL_SCALE))


def robust_sd(values: Array) -> float:
    """Standard deviation from the median absolute deviation, which is robust to a few outliers."""
    return MAD_TO_SD * float(np.median(np.abs(values - np.median(values))))


def median_std(values: Array, noise: float) -> float:
    """Standard deviation of a median, which a few readings on an edge do not change. Neighbouring readings
    see the same floor, so only a tenth of them counts as independent."""
    spread = max(robust_sd(values), noise)
    return float(np.sqrt(0.5 * np.pi) * spread / np.sqrt(max(len(values) / 10.0, 1.0)))
