"""Common parts of calibration drives: all readings are collected, and a drive that fails is reported as the
calibration's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from raccoon.core.errors import CalibrationError, MotionTimeout
from raccoon.core.readings import Inputs
from raccoon.robot.actions.actions import Action
from raccoon.robot.actions.functions import with_look

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

T = TypeVar("T")


def collect_inputs(action: Action[Any], inputs: list[Inputs]) -> Action[Any]:
    """The action, with the readings of all its ticks appended to `inputs`."""

    def look(robot: Robot) -> None:
        if robot.inputs is not None:
            inputs.append(robot.inputs)

    return with_look(action, look, f"watched {action.name}")


def run_calibration_drive(robot: Robot, action: Action[T]) -> T:
    """Run the drive of a calibration. Raises CalibrationError if the robot cannot drive."""
    try:
        return robot.run(action)
    except MotionTimeout as error:
        raise CalibrationError(f"the drive of the calibration failed: {error}") from error
