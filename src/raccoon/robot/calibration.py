"""Calibrations that a program runs on its robot before the match: wheels by a tape, tophats by a drive."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Inputs
from raccoon.robot.actions import Action, Steps, seq, wait
from raccoon.robot.conditions import after_distance
from raccoon.robot.driving import drive
from raccoon.robot.motions import straight

if TYPE_CHECKING:
    from raccoon.estimate.tophat import TophatCalibration
    from raccoon.robot.robot import Robot

REST = 1.0  # s of standing before and after a calibration drive


def watched(action: Action[Any], inputs: list[Inputs]) -> Action[Any]:
    """The action, with every reading of its ticks put into `inputs`."""

    def steps(robot: Robot) -> Steps[Any]:
        body = action.start(robot)
        try:
            while True:
                if robot.inputs is not None:
                    inputs.append(robot.inputs)
                try:
                    next(body)
                except StopIteration as end:
                    return end.value
                yield
        finally:
            body.close()

    return Action(f"watched {action.name}", steps)


def calibrate_drive(
    robot: Robot, taped: Callable[[], float], *, distance: float = 0.60, tape_std: float = 0.002
) -> RobotConfig:
    """Drive `distance` m straight, measure it by tape, and calibrate both wheels from it.

    The robot stands still for a second, drives, and stands again; then `taped` is asked for the m it went,
    straight from one resting place to the other; tape_std is that measurement's standard deviation, m. The
    tape gives the common scale of the wheels, the gyro's turn their ratio. Returns the configuration with
    the calibration in it: open the robot with it, or store it (`raccoon calibrate drive` does).

    Raises CalibrationError where the drive cannot support a calibration, saying what to do.
    """
    from raccoon.estimate.drive_calibration.straight import calibrate_straight

    readings: list[Inputs] = []
    robot.run(watched(seq(wait(REST), straight(distance), wait(REST)), readings))
    found = calibrate_straight(robot.config, readings, taped(), distance_std=tape_std)
    return found.applied(robot.config)


def calibrate_tophats(
    robot: Robot, distance: float = 0.60, speed: float | None = None
) -> dict[str, TophatCalibration]:
    """Drive `distance` m over floor and lines and calibrate every tophat from what it read.

    Returns the calibrations by name; they are in use from now on. Raises CalibrationError naming each tophat
    whose readings allow no threshold, and why; no calibration is changed then.
    """
    from raccoon.estimate.tophat import calibrate

    readings: list[Inputs] = []
    velocity = robot.config.motion.speed if speed is None else speed
    robot.run(watched(drive(velocity).until(after_distance(distance)), readings))
    found = {
        name: calibrate(_counts(readings, sensor.config.analog)) for name, sensor in robot.tophats.items()
    }
    useless = {name: each for name, each in found.items() if each.threshold is None}
    if useless:
        reasons = "; ".join(f"{name}: {each.verdict}, {each.reason}" for name, each in useless.items())
        raise CalibrationError(f"after {distance:g} m: {reasons}")
    for name, each in found.items():
        robot.tophat(name).calibrate(each)
    return found


def _counts(readings: list[Inputs], port: int) -> list[float]:
    return [counts for each in readings if (counts := each.analog[port]) is not None]
