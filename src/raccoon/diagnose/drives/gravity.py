"""Whether an accelerometer is in m/s2: whatever a robot does, it feels gravity."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import GRAVITY
from raccoon.diagnose.drives.magnitudes import MIN_SAMPLES, nearest_unit

Columns = Mapping[str, NDArray[np.float64]]

MIN_GRAVITY, MAX_GRAVITY = 7.0, 13.0
"""m/s2 that an accelerometer with its offsets may show of gravity."""
MAX_REMOVED_GRAVITY = 0.3
"""m/s2 that are left of gravity where a logger takes it out."""
ACCELERATION_UNITS: Mapping[str, float] = {"g": 1.0 / GRAVITY, "thousandths of g": 1000.0 / GRAVITY}
MIN_GRAVITY_COUNTS = 1500.0
"""Counts of gravity at least: a sensor of 16 bits has 2048 at 16 g."""


def describe_wrong_acceleration(columns: Columns) -> str:
    """What an accelerometer seems to be in that shows no 9.8 m/s2 of gravity; "" where it does or lacks an
    axis."""
    axes = [columns.get(f"imu.accel.{axis}") for axis in "xyz"]
    known = [each[np.isfinite(each)] for each in axes if each is not None]
    if len(known) < len(axes) or min(map(len, known)) < MIN_SAMPLES:
        return ""
    felt = math.hypot(*(float(np.mean(each)) for each in known))  # of driving, next to nothing: it ends
    if felt < MAX_REMOVED_GRAVITY or MIN_GRAVITY < felt < MAX_GRAVITY:
        return ""
    unit = (
        "the sensor's own counts"
        if felt > MIN_GRAVITY_COUNTS
        else nearest_unit(felt / GRAVITY, ACCELERATION_UNITS)
    )
    guess = f"it looks like {unit}, not m/s2" if unit else "is it in m/s2?"
    return f"imu.accel shows {felt:.4g} m/s2 of gravity, which is {GRAVITY:.1f}: {guess}"
