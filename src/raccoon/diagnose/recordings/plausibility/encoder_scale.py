"""An encoder with a wrong number of ticks per turn: one fault that looks like two causes.

If it reads s times the speed, the motor's K_E appears 1 / s of the true one, and so does the wheel's radius,
or whatever stands for the ratio of wheels and gyro.
"""

from __future__ import annotations

import math

from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.plausibility.common_fault import (
    MAX_SIGMAS_APART,
    MIN_RELATIVE_ERROR,
    attribute_to_one_fault,
    inverse_with_error,
)
from raccoon.diagnose.result import CauseResult, Diagnosis

BACK_EMF_CONSTANT = "motor.back_emf_constant"
SCALE_POWERS = {"drive.wheel_radius": 1.0, "imu.gyro_scale": 1.0, "drive.track_width": -1.0}
"""Power of K_E's factor by which each of them appears wrong if it stands for the ratio of wheels and gyro."""


def explain_by_encoder_scale(found: Diagnosis, robot: RobotConfig) -> Diagnosis:
    """The diagnosis with causes that a wrong number of ticks per turn explains attributed to it."""
    sides = {"left": robot.drive.left, "right": robot.drive.right}
    compared, causes = {each.name for each in found.channels}, found.causes
    for each in causes:
        ports = [port for side, port in sides.items() if each.where in (side, None)]
        columns = [f"motor.{port}.speed" for port in ports]
        others = [other for other in causes if other.where == each.where and _is_explained(other, each)]
        if each.id == BACK_EMF_CONSTANT and others and all(name in compared for name in columns):
            text, explained = (
                _describe_encoder_scale(each, others, " and ".join(columns)),
                [other.name for other in others],
            )
            found = attribute_to_one_fault(found, each.name, text, explained, _see_constant(each.name))
    return found


def _is_explained(cause: CauseResult, constant: CauseResult) -> bool:
    """Whether the same encoder explains the cause's value."""
    power = SCALE_POWERS.get(cause.id)
    other_factor, constant_factor = cause.parameters.get("factor"), constant.parameters.get("factor")
    if (
        power is None
        or other_factor is None
        or constant_factor is None
        or abs(math.log(constant_factor.value)) < MIN_RELATIVE_ERROR
    ):
        return False
    difference = math.log(other_factor.value) - power * math.log(constant_factor.value)
    return abs(difference) < MAX_SIGMAS_APART * math.hypot(
        other_factor.std / other_factor.value, constant_factor.std / constant_factor.value
    )


def _see_constant(name: str) -> str:
    return f"A wrong number of encoder ticks would cause an error of this size: see {name} first."


def _describe_encoder_scale(constant: CauseResult, others: list[CauseResult], columns: str) -> str:
    inverse, size = inverse_with_error(constant.parameters["factor"])
    direction = "much" if inverse > 1.0 else "little"
    causes = " and ".join(each.name for each in (constant, *others))
    verb = "read" if constant.where is None else "reads"
    return (
        f"{columns} {verb} {size} too {direction}, which alone explains {causes}: check the encoder's ticks "
        "per turn before anything else. If they are right, these are causes of their own."
    )
