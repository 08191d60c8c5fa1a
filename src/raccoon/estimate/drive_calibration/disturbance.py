"""Detection of disturbances of a calibration drive. Wheels that spin count a distance that the robot did not
move, and even a correct tape then gives wrong scales."""

from __future__ import annotations

from collections.abc import Iterable

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Inputs, Outputs
from raccoon.estimate.drive.odometry import Odometry

REMEDY = "clear its way and drive again"


def describe_disturbance(held: float, slipped: bool, told: Iterable[str]) -> str:
    """The disturbance of a drive and its remedy; "" if there was none.

    held: m that both wheels turned while their load was that at a wall. slipped: a wheel slipped in a motion
    that had begun without slip. told: reasons of the odometry.
    """
    if held > 0.0:
        return (
            f"the wheels may have spun for {held:.3f} m of the way, at a wall or at something heavy: {REMEDY}"
        )
    if any(reason.startswith("bumped") for reason in told):
        return f"the robot ran into something on the way: {REMEDY}"
    if slipped:
        return f"a wheel slipped on the way: {REMEDY}"
    return ""


def find_disturbance(robot: RobotConfig, cycles: Iterable[tuple[Inputs, Outputs | None]]) -> str:
    """`describe_disturbance` for a recorded drive: inputs, and the command in force (None: unknown)."""
    odometry = Odometry(robot)
    held, slipped, told = 0.0, False, set[str]()
    for inputs, command in cycles:
        told.update(odometry.update(inputs, command).reasons)
        held, slipped = max(held, odometry.held_way), slipped or odometry.slipped
    return describe_disturbance(held, slipped, told)
