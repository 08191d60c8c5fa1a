"""Commands in another scale than -1 to 1 (such as 127 for a driver's 100): one fault that looks like several
causes.

If the columns hold s times the true commands, the simulated motors get s times their voltage. All speeds are
s times the true ones, so the back-EMF reading appears 1 / s of its expected value, as does whatever links
wheels and gyro. Currents and torques, and so the fitted friction, are s times the true ones. The battery's
load, duty times current, is s squared times the true one, so its resistance appears 1 / s squared of the true
one.
"""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.plausibility.battery_scale import BATTERY_VOLTAGE, BEMF_SCALE
from raccoon.diagnose.recordings.plausibility.common_fault import (
    MAX_SIGMAS_APART,
    MIN_RELATIVE_ERROR,
    attribute_to_one_fault,
    inverse_with_error,
)
from raccoon.diagnose.result import CauseResult, Diagnosis

SCALE_POWERS = {
    "imu.gyro_scale": 1.0,
    "drive.wheel_radius": 1.0,
    "drive.track_width": -1.0,
    "friction.coulomb": -1.0,
    "battery.internal_resistance": 2.0,
}
"""Power of the back-EMF's scale by which each of them appears wrong."""
MIN_EXPLAINED_CAUSES = 2
"""Least number of causes that it must explain: a single one may fit by chance or by another fault."""
SEE_BEMF_SCALE = f"Commands of another scale would cause an error of this size: see {BEMF_SCALE} first."


def explain_by_command_scale(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """The diagnosis with causes that a wrong scale of the commands explains attributed to it."""
    by_name = {each.name: each for each in found.causes}
    scale = by_name.get(BEMF_SCALE)
    if (
        scale is None
        or BATTERY_VOLTAGE in by_name
        or abs(math.log(scale.parameters["factor"].value)) < MIN_RELATIVE_ERROR
    ):
        return found
    prior_stds = {
        "friction.coulomb": robot.model.friction.coulomb.std,
        "battery.internal_resistance": robot.model.battery.internal_resistance.std,
    }
    names = [each.name for each in found.causes if _is_explained(each, scale, prior_stds.get(each.id, 0.0))]
    if len(names) < MIN_EXPLAINED_CAUSES:
        return found
    return attribute_to_one_fault(
        found, BEMF_SCALE, _describe_command_scale(scale, names, robot), names, SEE_BEMF_SCALE
    )


def _is_explained(cause: CauseResult, scale: CauseResult, prior_std: float) -> bool:
    """Whether the same commands explain a cause's value. prior_std: standard deviation of robot.toml's
    value."""
    power = SCALE_POWERS.get(cause.id)
    if power is None or cause.where is not None or len(cause.parameters) != 1:
        return False
    (number,), factor = cause.parameters.values(), scale.parameters["factor"]
    if not (number.value > 0.0 and number.nominal > 0.0):
        return False
    difference = math.log(number.value / number.nominal) - power * math.log(factor.value)
    relative_std = math.hypot(number.std / number.value, prior_std / number.nominal)
    return abs(difference) < MAX_SIGMAS_APART * math.hypot(relative_std, power * factor.std / factor.value)


def _describe_command_scale(scale: CauseResult, names: list[str], robot: RobotConfig) -> str:
    inverse, size = inverse_with_error(scale.parameters["factor"])
    direction = "large" if inverse > 1.0 else "small"
    *most, last = (BEMF_SCALE, *names)
    commands = " and ".join(f"motor.{port}.duty" for port in (robot.drive.left, robot.drive.right))
    return (
        f"The commands {commands} are {size} too {direction}, which alone explains {', '.join(most)} and "
        f"{last}: before anything else, check that full power is 1 in them. If it is, these are causes of "
        "their own."
    )
