"""A battery that is read too high or too low: one fault, which looks like several.

The simulated motors get the volts that the battery's reading says. Where that is s times too high, so is all
that is counted in volts: the battery's voltage is s times robot.toml's, the back-EMF reading seems 1 / s of
what it should be, and where wheels and gyro tell, so do their scale, a radius, K_E or the track.
"""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT
from raccoon.diagnose.recordings.doubts.one_fault import ALIKE, LEAST, told_as_one
from raccoon.diagnose.result import CauseResult, Diagnosis

VOLTAGE, SCALE, READING = "battery.open_circuit_voltage", "bemf.scale", "battery.voltage"
FOLLOWS = {
    "imu.gyro_scale": -1.0,
    "drive.wheel_radius": -1.0,
    "drive.track_width": 1.0,
    "motor.back_emf_constant": 1.0,
}
"""Power of s with which each of them stands for what is left where only wheels and gyro are compared."""
KIPR_VOLTS_PER_COUNT = 0.009175
"""V, of the C library's own curve of the charge."""
OF_KIPR = 0.01
"""Part by which a scale may be off from that curve to be of it."""


def with_battery_reading(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """A diagnosis that says in one sentence what a wrong scale of the battery's reading has made of it."""
    by_name = {each.name: each for each in found.causes}
    voltage, scale = by_name.get(VOLTAGE), by_name.get(SCALE)
    if voltage is None or scale is None or not any(each.name == READING for each in found.channels):
        return found
    full = robot.model.battery.open_circuit_voltage
    volts, factor = voltage.parameters["voltage"], scale.parameters["factor"]
    too_high = -math.log(factor.value)
    off = math.log(volts.value / volts.nominal) - too_high
    known = math.hypot(volts.std / volts.value, full.std / full.value, factor.std)
    if abs(too_high) < LEAST or abs(off) > ALIKE * known:
        return found
    others = [each for each in found.causes if _follows(each, too_high)]
    part = [SCALE, *(each.name for each in others)]
    return told_as_one(found, VOLTAGE, _said(voltage, too_high, factor.std, part), part, SEE)


SEE = f"It is of the size that a wrong scale of the battery's reading makes: see {VOLTAGE} first."


def _follows(cause: CauseResult, too_high: float) -> bool:
    number = cause.parameters.get("factor")
    power = FOLLOWS.get(cause.id)
    if number is None or power is None or cause.where is not None:
        return False
    return abs(math.log(number.value / (number.nominal or 1.0)) - power * too_high) < ALIKE * number.std


def _said(voltage: CauseResult, too_high: float, std: float, part: list[str]) -> str:
    scale = math.exp(too_high)
    way = "high" if too_high > 0.0 else "low"
    kipr = KIPR_VOLTS_PER_COUNT / BATTERY_VOLTS_PER_COUNT
    curve = (
        f" KIPR's library takes {KIPR_VOLTS_PER_COUNT:g} V a count, the controller's divider makes "
        f"{BATTERY_VOLTS_PER_COUNT:.6f}."
        if abs(scale / kipr - 1.0) < OF_KIPR
        else ""
    )
    *most, last = (voltage.name, *part)
    number = voltage.parameters["voltage"]
    size = f"{100.0 * abs(scale - 1.0):.1f} +- {100.0 * std:.1f} % too {way}"
    return (
        f"The battery's reading is {size}, which alone makes {', '.join(most)} and {last}: compare it with a "
        f"multimeter and mend its scale before anything else.{curve} If the multimeter agrees with it, the "
        f"battery has {number.value:.2f} V without load, not {number.nominal:.2f}, and the others are causes "
        "of their own."
    )
