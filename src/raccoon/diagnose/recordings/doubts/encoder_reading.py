"""An encoder that is counted with the wrong number of ticks: one fault, which looks like two.

Where it reads s times the speed, the motor seems to need 1 / s of its K_E, and a gyro turns as if the wheel's
radius were 1 / s of what it is, or what else stands for the ratio of wheels and gyro.
"""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.doubts.one_fault import ALIKE, LEAST, inverse_off, told_as_one
from raccoon.diagnose.result import CauseResult, Diagnosis

CONSTANT = "motor.back_emf_constant"
FOLLOWS = {"drive.wheel_radius": 1.0, "imu.gyro_scale": 1.0, "drive.track_width": -1.0}
"""Power of K_E's factor with which each of them stands for what wheels and gyro are compared by."""


def with_encoder_reading(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """A diagnosis that says in one sentence what a wrong number of ticks a turn has made of it."""
    sides = {"left": robot.drive.left, "right": robot.drive.right}
    seen, causes = {each.name for each in found.channels}, found.causes
    for each in causes:
        ports = [port for side, port in sides.items() if each.where in (side, None)]
        names = [f"motor.{port}.speed" for port in ports]
        others = [other for other in causes if other.where == each.where and _follows(other, each)]
        if each.id == CONSTANT and others and all(name in seen for name in names):
            said, names_of = _said(each, others, " and ".join(names)), [other.name for other in others]
            found = told_as_one(found, each.name, said, names_of, _see(each.name))
    return found


def _follows(other: CauseResult, constant: CauseResult) -> bool:
    """Whether the other's number is what the same encoder would make of it."""
    power = FOLLOWS.get(other.id)
    one, two = other.parameters.get("factor"), constant.parameters.get("factor")
    if power is None or one is None or two is None or abs(math.log(two.value)) < LEAST:
        return False
    off = math.log(one.value) - power * math.log(two.value)
    return abs(off) < ALIKE * math.hypot(one.std / one.value, two.std / two.value)


def _see(name: str) -> str:
    return f"It is of the size that a wrong number of the encoder's ticks makes: see {name} first."


def _said(constant: CauseResult, others: list[CauseResult], names: str) -> str:
    reads, size = inverse_off(constant.parameters["factor"])
    way = "much" if reads > 1.0 else "little"
    part = " and ".join(each.name for each in (constant, *others))
    verb = "read" if constant.where is None else "reads"
    return (
        f"{names} {verb} {size} too {way}, which alone makes {part}: check the encoder's ticks per turn "
        "before anything else. If they are right, these are causes of their own."
    )
