"""Values of [model] that a calibration in robot.toml overrides, so that the robot's programs do not use
them."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.core.config import RobotConfig
from raccoon.diagnose.result import CauseResult


def overridden_model_notes(causes: Sequence[CauseResult], robot: RobotConfig) -> tuple[str, ...]:
    """A note if a named cause is a value of [model] that this robot's programs do not use."""
    ports = {"left": (robot.drive.left,), "right": (robot.drive.right,)}
    keys = [
        (f"motor.{port}.{key}", f"model.{number}")
        for cause in causes
        for port in ports.get(cause.where or "", (robot.drive.left, robot.drive.right))
        for key, numbers in robot.motor(port).before_model().items()
        for number in numbers
        if number.startswith(cause.id)  # drive.inertia: the inertia of straight driving
    ]
    if not keys:
        return ()
    calibrations, model_keys = (", ".join(dict.fromkeys(each)) for each in zip(*keys, strict=True))
    return (
        f"robot.toml has {calibrations}, which programs use instead of {model_keys}: a new value there "
        "changes the simulation alone; calibrate again if the robot has changed",
    )
