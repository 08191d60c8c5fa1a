"""The wheels' calibration: a straight drive along a tape."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, cast

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Inputs
from raccoon.robot.actions.actions import wait
from raccoon.robot.actions.limits import (
    check_function,
    check_positive,
    check_robot,
    check_tolerance,
    check_way,
)
from raccoon.robot.calibration.calibration_drives import collect_inputs, run_calibration_drive
from raccoon.robot.motions.goals import straight
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

ASKED = 3  # times that somebody is asked who may have typed centimetres: another drive takes longer
REST_S = 1.0  # s of standing before and after the drive


def calibrate_drive(
    robot: Robot,
    taped: Callable[[], float | str],
    *,
    distance: float = 0.60,
    speed: float | None = None,
    tape_std: float = 0.002,
) -> RobotConfig:
    """Drive `distance` m straight, measure it by tape, and calibrate both wheels from it.

    The robot stands for a second, drives (speed: m/s, `motion.speed` when None), and stands again. Then
    `taped` is called for the distance (m) in a straight line from the first to the last place of rest;
    tape_std is its standard deviation, m. The tape gives the common scale of the wheels, the gyro's turn
    their ratio. Returns the configuration with the calibration in it: open the robot with it, or store it (as
    `raccoon calibrate drive` does). A result far from the configuration is reported in the log and the
    recording.

    Raises CalibrationError, saying what to do, if the drive cannot support a calibration, or something held
    or bumped the robot; TypeError before anything moves if `taped` is not a function; TypeError or ValueError
    if it returns no possible distance when called for the third time.
    """
    from raccoon.estimate.drive_calibration.disturbance import describe_disturbance
    from raccoon.estimate.drive_calibration.straight import calibrate_straight

    check_robot(robot, "calibrate_drive()")
    robot.require("calibrate_drive()")
    check_function(taped, "calibrate_drive()")
    check_positive("tape_std", tape_std)
    check_tolerance(tape_std=tape_std)
    readings: list[Inputs] = []
    run_calibration_drive(robot, collect_inputs(wait(REST_S), readings))
    result = run_calibration_drive(robot, collect_inputs(straight(distance, speed), readings))
    if why := describe_disturbance(result.held, robot.odometry.slipped, result.remarks):
        raise CalibrationError(f"this drive cannot be used for the calibration: {why}")
    run_calibration_drive(robot, collect_inputs(wait(REST_S), readings))
    found = calibrate_straight(robot.config, readings, _ask_distance(taped), distance_std=tape_std)
    for remark in found.remarks:
        add_remark(robot, remark)
    return found.applied(robot.config)


def _ask_distance(taped: Callable[[], float | str]) -> float:
    """The distance (m) that `taped` returns, also as a text (of `input`). It is asked again for anything that
    is not a possible distance; then its last error is raised."""
    left = ASKED
    while True:
        left -= 1
        try:
            way = taped()
            with suppress(ValueError):
                way = float(way.replace(",", ".")) if isinstance(way, str) else way
            check_way(**{"the taped way": cast(float, way)})
            return cast(float, way)
        except (TypeError, ValueError) as error:
            if not left:
                raise
            logging.getLogger("raccoon").warning("%s: once more", error)
