"""Checks of a motor's voltage and speed: units and signs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.channels.saturation import saturation_fault
from raccoon.diagnose.result import ParameterResult, SensorFault

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

BATTERY = "battery.voltage"
MIN_SAMPLES = 50
"""Least number of samples of a reading that is checked."""
MIN_BATTERY_V = 3.0
"""Battery voltage, V, above which no experiment keeps a motor below 1 V all the time."""
MAX_VOLTS_RATIO = 1.3
"""Voltage over the battery's that no driver gives a motor."""
MIN_OPPOSITE_SHARE = 0.2
"""Share of the larger reading that the reading in the other direction must reach for a motor that goes both
ways."""
MAX_K_E_RATIO = 3.0
"""Ratio of two motors' K_E that no robot has: with their gears they are of similar size."""
MIN_SATURATION_STEP = 0.005
"""Least step with which a speed reaches its limit if it is saturated, as a share of the largest speed. A
speed without noise approaches its final value slowly and stays there too."""


def speed_saturation_fault(name: str, speed: Array) -> SensorFault | None:
    """The fault of a saturated speed, None otherwise. Such a speed made friction twice as large."""
    fault = saturation_fault(name, "speed", speed)
    known = speed[np.isfinite(speed)]
    if fault is None:
        return None
    at_limit = (known == known.max()) | (known == known.min())
    arrivals = np.flatnonzero(at_limit[1:] & ~at_limit[:-1])
    before = np.maximum(arrivals - 1, 0)  # the sample just before may be in between
    step = float(np.median(np.abs(known[arrivals + 1] - known[before]))) if len(arrivals) else 0.0
    return fault if step > MIN_SATURATION_STEP * float(np.abs(known).max()) else None


def check_volts(columns: Columns, port: int) -> None:
    """Raise TraceError if voltage or speed are in another unit or lack their sign."""
    voltage, speed = (columns.get(f"motor.{port}.{kind}") for kind in ("voltage", "speed"))
    battery = columns.get(BATTERY)
    if voltage is None or not np.isfinite(voltage).any():
        return
    largest = float(np.nanmax(np.abs(voltage)))
    full = 0.0 if battery is None or not np.isfinite(battery).any() else float(np.nanmedian(battery))
    if full > 0.0 and largest > MAX_VOLTS_RATIO * full:
        raise TraceError(
            f"motor.{port}.voltage reaches {largest:g} V of a battery of {full:.3g} V: it looks like "
            "percent, millivolts or counts, or the battery's reading is in another unit"
        )
    if full > MIN_BATTERY_V and 0.0 < largest <= 1.0:
        raise TraceError(
            f"motor.{port}.voltage reaches {largest:g} V at most, of {full:.3g} V: it looks like "
            "a duty from -1 to 1, not volts; multiply it by the battery's voltage"
        )
    if speed is None:
        return
    for values, other, name in ((voltage, speed, "voltage"), (speed, voltage, "speed")):
        if _has_varying_values(values) and _is_one_way(values) and not _is_one_way(other):
            raise TraceError(
                f"motor.{port}.{name} has one sign only, and the motor went both ways: it holds how large it "
                "was, not which way; write it with its sign"
            )


def _has_varying_values(values: Array) -> bool:
    """Whether there are enough values and they vary; missing or stuck readings have their own faults."""
    known = values[np.isfinite(values)]
    return len(known) >= MIN_SAMPLES and float(np.ptp(known)) > 0.0


def _is_one_way(values: Array) -> bool:
    known = values[np.isfinite(values)]
    if len(known) < MIN_SAMPLES:
        return True
    low, high = (float(each) for each in np.percentile(known, [5.0, 95.0]))
    return low * high >= -(MIN_OPPOSITE_SHARE**2) * max(abs(low), abs(high)) ** 2


def unlike_motor_notes(identified: Mapping[str, ParameterResult]) -> tuple[str, ...]:
    """A note if the K_E of two motors differ as with a speed in another unit: with rpm or degrees per second,
    friction and inertia are too small by the same factor. identified: parameters by name."""
    constants = {name: each.value for name, each in identified.items() if name.endswith(".back_emf")}
    if len(constants) < 2 or not min(constants.values()) > 0.0:
        return ()
    low, high = min(constants, key=constants.__getitem__), max(constants, key=constants.__getitem__)
    if constants[high] < MAX_K_E_RATIO * constants[low]:
        return ()
    speed = f"{low.removesuffix('.back_emf')}.speed"
    return (
        f"{high} is {constants[high] / constants[low]:.1f} times {low}: if the motors are alike, {speed} is "
        "in another unit than rad/s, and its motor's numbers mean nothing",
    )
