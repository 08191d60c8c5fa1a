"""A battery reading with a wrong scale: one fault that looks like several causes.

The simulated motors get the voltage of the battery's reading. If that is s times too high, so is every
voltage: the battery's is s times robot.toml's, and the back-EMF reading appears 1 / s of its expected value.
In the comparison of wheels and gyro, the gyro's scale, a radius, K_E or the track width appears wrong by s or
1 / s.
"""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT
from raccoon.diagnose.recordings.plausibility.common_fault import (
    MAX_SIGMAS_APART,
    MIN_RELATIVE_ERROR,
    attribute_to_one_fault,
)
from raccoon.diagnose.result import CauseResult, Diagnosis

BATTERY_VOLTAGE, BEMF_SCALE, BATTERY_COLUMN = "battery.open_circuit_voltage", "bemf.scale", "battery.voltage"
SCALE_POWERS = {
    "imu.gyro_scale": -1.0,
    "drive.wheel_radius": -1.0,
    "drive.track_width": 1.0,
    "motor.back_emf_constant": 1.0,
}
"""Power of s by which each of them appears wrong if it stands for the ratio of wheels and gyro."""
KIPR_VOLTS_PER_COUNT = 0.009175
"""Volts per count that the C library's battery charge function assumes."""
KIPR_TOLERANCE = 0.01
"""Relative difference from it within which a scale is attributed to the library."""
SEE_BATTERY = (
    f"A wrong scale of the battery's reading would cause an error of this size: see {BATTERY_VOLTAGE} first."
)


def explain_by_battery_scale(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """The diagnosis with causes that a wrong scale of the battery's reading explains attributed to it."""
    by_name = {each.name: each for each in found.causes}
    voltage, scale = by_name.get(BATTERY_VOLTAGE), by_name.get(BEMF_SCALE)
    if voltage is None or scale is None or not any(each.name == BATTERY_COLUMN for each in found.channels):
        return found
    prior_voltage = robot.model.battery.open_circuit_voltage
    volts, factor = voltage.parameters["voltage"], scale.parameters["factor"]
    log_scale = -math.log(factor.value)
    difference = math.log(volts.value / volts.nominal) - log_scale
    std = math.hypot(volts.std / volts.value, prior_voltage.std / prior_voltage.value, factor.std)
    if abs(log_scale) < MIN_RELATIVE_ERROR or abs(difference) > MAX_SIGMAS_APART * std:
        return found
    others = [each for each in found.causes if _is_explained(each, log_scale)]
    names = [BEMF_SCALE, *(each.name for each in others)]
    return attribute_to_one_fault(
        found,
        BATTERY_VOLTAGE,
        _describe_battery_scale(voltage, log_scale, factor.std, names),
        names,
        SEE_BATTERY,
    )


def _is_explained(cause: CauseResult, log_scale: float) -> bool:
    number = cause.parameters.get("factor")
    power = SCALE_POWERS.get(cause.id)
    if number is None or power is None or cause.where is not None:
        return False
    return (
        abs(math.log(number.value / (number.nominal or 1.0)) - power * log_scale)
        < MAX_SIGMAS_APART * number.std
    )


def _describe_battery_scale(voltage: CauseResult, log_scale: float, std: float, names: list[str]) -> str:
    scale = math.exp(log_scale)
    direction = "high" if log_scale > 0.0 else "low"
    kipr_scale = KIPR_VOLTS_PER_COUNT / BATTERY_VOLTS_PER_COUNT
    kipr_hint = (
        f" KIPR's library assumes {KIPR_VOLTS_PER_COUNT:g} V a count, the controller's divider gives "
        f"{BATTERY_VOLTS_PER_COUNT:.6f}."
        if abs(scale / kipr_scale - 1.0) < KIPR_TOLERANCE
        else ""
    )
    *most, last = (voltage.name, *names)
    number = voltage.parameters["voltage"]
    size = f"{100.0 * abs(scale - 1.0):.1f} +- {100.0 * std:.1f} % too {direction}"
    return (
        f"The battery's reading is {size}, which alone explains {', '.join(most)} and {last}: compare it "
        f"with a multimeter and correct its scale before anything else.{kipr_hint} If the multimeter agrees "
        f"with it, the battery has {number.value:.2f} V without load, not {number.nominal:.2f}, and the "
        "others are causes of their own."
    )
