"""What the drives of calibrations share: every reading is kept, and one that fails is said to be theirs."""

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
    """The action, with every reading of its ticks put into `inputs`."""

    def look(robot: Robot) -> None:
        if robot.inputs is not None:
            inputs.append(robot.inputs)

    return with_look(action, look, f"watched {action.name}")


def run_calibration_drive(robot: Robot, action: Action[T]) -> T:
    """Do the drive of a calibration; a robot that cannot drive cannot be calibrated."""
    try:
        return robot.run(action)
    except MotionTimeout as error:
        raise CalibrationError(f"the drive of the calibration failed: {error}") from error
