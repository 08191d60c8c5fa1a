"""Noise of a reflectance sensor's readings: the sensor's own, and what the floor's pattern makes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MIN_READINGS = 8
"""Readings that an estimate needs."""
MIN_SD = 1.0
"""Counts; a converter's own steps are no less."""
MIN_PATTERN_RATIO = 1.5
"""Ratio of the floor's pattern over both surfaces from which it can be told from the sensor's noise."""
OUTLIER_SDS = 5.0
"""Standard deviations of the noise from which a step between neighbours is an outlier."""
FLOOR_BRIGHTNESS_SD = 0.02
"""Relative standard deviation of a floor's brightness (`raccoon.model.reflectance.read`)."""
MAD_TO_SD = 1.4826
"""Standard deviation of normal numbers over their median absolute deviation."""


def noise_sd(steps: Array) -> float:
    """Standard deviation of a reading by the steps between neighbours, without those at edges and spikes."""
    rough = max(MAD_TO_SD * float(np.median(np.abs(steps))), np.sqrt(2.0) * MIN_SD)
    inliers = steps[np.abs(steps) < OUTLIER_SDS * rough]
    return max(float(np.sqrt(np.mean(inliers**2) / 2.0)), MIN_SD)


def sensor_noise(
    steps: Array, pairs: Flags, black: Flags, medians: tuple[float, float], noise: float
) -> tuple[float, float]:
    """Standard deviation of a reading, and how much of it the floor may make. noise: the result where no
    surface has enough readings.

    A converter's noise is the same over both surfaces; a floor's pattern grows with the slope of the reading,
    and shows over white, and flickering lamps show over black. So with n² = e² + g² p² over either surface,
    where p is `floor_pattern`, the noise is e; where no g solves that it is the smaller n.
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
    """Standard deviation, counts, that a floor's varying brightness makes at a level: counts = 4095 / (1 + x)
    has the slope -counts (1 - counts / 4095) over the logarithm of light x."""
    return FLOOR_BRIGHTNESS_SD * abs(level * (1.0 - level / FULL_SCALE))


def robust_sd(values: Array) -> float:
    """Standard deviation by the median absolute deviation, which a few outliers do not widen."""
    return MAD_TO_SD * float(np.median(np.abs(values - np.median(values))))


def median_std(values: Array, noise: float) -> float:
    """Standard deviation of a median, which some readings on an edge do not move. Neighbouring readings see
    the same floor, so a tenth of them counts as independent."""
    spread = max(robust_sd(values), noise)
    return float(np.sqrt(0.5 * np.pi) * spread / np.sqrt(max(len(values) / 10.0, 1.0)))
