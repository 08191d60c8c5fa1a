"""Commands that are written in another scale than -1 to 1, as 127 for all of a driver's 100: one fault, which
looks like several.

Where the columns hold s of what the motors got, the simulated motors get s of their volts. All speeds are s
of what they were, so the back-EMF reading seems 1 / s of what it should be, and so does what wheels and gyro
are compared by. Currents and torques are s of theirs, so is the friction that fits, and what the battery
carries, duty times current, is s squared: its resistance seems 1 / s squared of what it is.
"""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.doubts.battery_reading import SCALE, VOLTAGE
from raccoon.diagnose.recordings.doubts.one_fault import ALIKE, LEAST, inverse_off, told_as_one
from raccoon.diagnose.result import CauseResult, Diagnosis

FOLLOWS = {
    "imu.gyro_scale": 1.0,
    "drive.wheel_radius": 1.0,
    "drive.track_width": -1.0,
    "friction.coulomb": -1.0,
    "battery.internal_resistance": 2.0,
}
"""Power of the back-EMF's scale with which each of them stands."""
FEWEST = 2
"""Causes that follow it: one may by chance, or by the twin of another fault."""
SEE = f"It is of the size that commands of another scale make: see {SCALE} first."


def with_command_scale(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """A diagnosis that says in one sentence what a wrong scale of the commands has made of it."""
    by_name = {each.name: each for each in found.causes}
    scale = by_name.get(SCALE)
    if scale is None or VOLTAGE in by_name or abs(math.log(scale.parameters["factor"].value)) < LEAST:
        return found
    known = {
        "friction.coulomb": robot.model.friction.coulomb.std,
        "battery.internal_resistance": robot.model.battery.internal_resistance.std,
    }
    part = [each.name for each in found.causes if _follows(each, scale, known.get(each.id, 0.0))]
    if len(part) < FEWEST:
        return found
    return told_as_one(found, SCALE, _said(scale, part, robot), part, SEE)


def _follows(cause: CauseResult, scale: CauseResult, tolerance: float) -> bool:
    """Whether a cause's number is what the same commands would make of it; tolerance: of robot.toml's."""
    power = FOLLOWS.get(cause.id)
    if power is None or cause.where is not None or len(cause.parameters) != 1:
        return False
    (number,), factor = cause.parameters.values(), scale.parameters["factor"]
    if not (number.value > 0.0 and number.nominal > 0.0):
        return False
    off = math.log(number.value / number.nominal) - power * math.log(factor.value)
    own = math.hypot(number.std / number.value, tolerance / number.nominal)
    return abs(off) < ALIKE * math.hypot(own, power * factor.std / factor.value)


def _said(scale: CauseResult, part: list[str], robot: RobotConfig) -> str:
    holds, size = inverse_off(scale.parameters["factor"])
    way = "large" if holds > 1.0 else "small"
    *most, last = (SCALE, *part)
    commands = " and ".join(f"motor.{port}.duty" for port in (robot.drive.left, robot.drive.right))
    return (
        f"The commands {commands} are {size} too {way}, which alone makes {', '.join(most)} and {last}: look "
        "whether all that a driver can give is 1 in them before anything else. If it is, these are causes of "
        "their own."
    )
