"""The wheels' calibration: a straight drive along a tape."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Inputs
from raccoon.robot.actions.actions import wait
from raccoon.robot.actions.limits import check_function, check_limits, check_robot, check_way
from raccoon.robot.calibration.drives import driven, watched
from raccoon.robot.motions.goals import straight
from raccoon.robot.remarks import say

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

REST = 1.0  # s of standing before and after the drive


def calibrate_drive(
    robot: Robot,
    taped: Callable[[], float],
    *,
    distance: float = 0.60,
    speed: float | None = None,
    tape_std: float = 0.002,
) -> RobotConfig:
    """Drive `distance` m straight, measure it by tape, and calibrate both wheels from it.

    The robot stands still for a second, drives (speed: m/s, `motion.speed` when None), and stands again; then
    `taped` is asked for the m it went, straight from one resting place to the other; tape_std is that
    measurement's standard deviation, m. The tape gives the common scale of the wheels, the gyro's turn their
    ratio. Returns the configuration with the calibration in it: open the robot with it, or store it (`raccoon
    calibrate drive` does).

    A result that is far from what the configuration says is said, in the log and the recording.

    Raises CalibrationError where the drive cannot support a calibration, or something held or bumped the
    robot on its way, saying what to do; TypeError before anything moves where `taped` is no function, and
    TypeError or ValueError where it gives no such distance.
    """
    from raccoon.estimate.drive_calibration.disturbed import disturbance
    from raccoon.estimate.drive_calibration.straight import calibrate_straight

    check_robot(robot, "calibrate_drive()")
    robot.require("calibrate_drive()")
    check_function(taped, "calibrate_drive()")
    check_limits(tape_std=tape_std)
    readings: list[Inputs] = []
    driven(robot, watched(wait(REST), readings))
    result = driven(robot, watched(straight(distance, speed), readings))
    if why := disturbance(result.held, robot.odometry.slipped, result.remarks):
        raise CalibrationError(f"the drive of the calibration tells nothing: {why}")
    driven(robot, watched(wait(REST), readings))
    way = taped()
    check_way(**{"the taped way": way})
    found = calibrate_straight(robot.config, readings, way, distance_std=tape_std)
    for remark in found.remarks:
        say(robot, remark)
    return found.applied(robot.config)
