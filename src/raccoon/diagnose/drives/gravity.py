"""Check of an accelerometer's unit by gravity, which it measures whatever the robot does."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.readings import GRAVITY
from raccoon.diagnose.drives.magnitudes import MIN_SAMPLES, nearest_unit

Columns = Mapping[str, NDArray[np.float64]]

MIN_GRAVITY, MAX_GRAVITY = 7.0, 13.0
"""Range of gravity, m/s2, that an accelerometer with offsets may show."""
MAX_REMOVED_GRAVITY = 0.3
"""Largest remaining gravity, m/s2, of a logger that subtracts it."""
ACCELERATION_UNITS: Mapping[str, float] = {"g": 1.0 / GRAVITY, "thousandths of g": 1000.0 / GRAVITY}
MIN_GRAVITY_COUNTS = 1500.0
"""Least gravity in a sensor's raw counts: a 16-bit sensor with a range of 16 g has 2048."""


def describe_wrong_acceleration(columns: Columns) -> str:
    """Describes the unit that an accelerometer seems to have if it does not show 9.8 m/s2 of gravity; "" if
    it does or an axis is missing."""
    axes = [columns.get(f"imu.accel.{axis}") for axis in "xyz"]
    known = [each[np.isfinite(each)] for each in axes if each is not None]
    if len(known) < len(axes) or min(map(len, known)) < MIN_SAMPLES:
        return ""
    # The mean acceleration of driving is next to 0, since it ends at rest.
    felt = math.hypot(*(float(np.mean(each)) for each in known))
    if felt < MAX_REMOVED_GRAVITY or MIN_GRAVITY < felt < MAX_GRAVITY:
        return ""
    unit = (
        "the sensor's own counts"
        if felt > MIN_GRAVITY_COUNTS
        else nearest_unit(felt / GRAVITY, ACCELERATION_UNITS)
    )
    guess = f"it looks like {unit}, not m/s2" if unit else "is it in m/s2?"
    return f"imu.accel shows {felt:.4g} m/s2 of gravity, which is {GRAVITY:.1f}: {guess}"
