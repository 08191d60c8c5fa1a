"""How much a reflectance sensor's readings differ from one to the next, of itself and by the floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MIN_READINGS = 8
"""Readings from which something is said of them."""
MIN_SD = 1.0
"""Counts; a converter's own steps are no less."""
MIN_PATTERN_RATIO = 1.5
"""How much more a floor's pattern must show over one surface to be told from noise."""
OUTLIER_SDS = 5.0
"""Noise deviations from which a step between neighbours is no noise."""
FLOOR_BRIGHTNESS_SD = 0.02
"""Of its light by which one piece of floor differs from another (`raccoon.model.reflectance.read`)."""
MAD_TO_SD = 1.4826
"""Standard deviation of normal numbers over their median distance from the middle."""


def noise_sd(steps: Array) -> float:
    """Deviation of a reading from the steps between neighbours, those at edges and spikes left out."""
    rough = max(MAD_TO_SD * float(np.median(np.abs(steps))), np.sqrt(2.0) * MIN_SD)
    inliers = steps[np.abs(steps) < OUTLIER_SDS * rough]
    return max(float(np.sqrt(np.mean(inliers**2) / 2.0)), MIN_SD)


def sensor_noise(
    steps: Array, pairs: Flags, black: Flags, medians: tuple[float, float], noise: float
) -> tuple[float, float]:
    """Deviation of a reading, and how much of it the floor may make. noise: where no surface has enough.

    A converter's noise is the same over both surfaces; a floor's own pattern goes with the slope of the
    reading, and shows over white, and flickering lamps show over black. So with n² = e² + g² p² on either
    surface, p as `floor_pattern` has it, the noise is e; where that has no g it is the smaller n.
    """
    found = []
    for side in (False, True):
        mine = pairs & (black[1:] == side)
        if mine.sum() >= MIN_READINGS:
            found.append((noise_sd(steps[mine]), floor_pattern(medians[int(side)])))
    if len(found) < 2:
        return found[0] if found else (noise, max(map(floor_pattern, medians)))
    found.sort()
    (less, little), (more, much) = found
    if much < MIN_PATTERN_RATIO * little:
        return less, min(little, much)
    square = (less**2 * much**2 - more**2 * little**2) / (much**2 - little**2)
    return max(float(np.sqrt(max(square, 0.0))), MIN_SD), 0.0


def floor_pattern(level: float) -> float:
    """Counts that a floor's own brightness makes: counts = 4095 / (1 + x) has the slope -counts (1 - counts /
    4095) over the logarithm of light x."""
    return FLOOR_BRIGHTNESS_SD * abs(level * (1.0 - level / FULL_SCALE))


def robust_sd(values: Array) -> float:
    """Their standard deviation where they are normal; a few that are far off do not widen it."""
    return MAD_TO_SD * float(np.median(np.abs(values - np.median(values))))


def median_std(values: Array, noise: float) -> float:
    """Deviation of a median, which some readings on an edge do not move. The floor's own brightness is alike
    for neighbouring readings: a tenth of them counts."""
    spread = max(robust_sd(values), noise)
    return float(np.sqrt(0.5 * np.pi) * spread / np.sqrt(max(len(values) / 10.0, 1.0)))
