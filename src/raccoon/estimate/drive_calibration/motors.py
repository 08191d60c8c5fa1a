"""Results of every drive calibration: both motors' radians per tick and back-EMF offsets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from raccoon.core.config import Measured, MotorConfig, RobotConfig


@dataclass(frozen=True, slots=True)
class MotorsCalibration:
    """Values with their standard deviations.

    left, right: radians per tick. left_offset, right_offset: back-EMF counts at rest with the board's sign;
    None if the recording has no rest with back-EMF.
    """

    left: Measured
    right: Measured
    left_offset: Measured | None
    right_offset: Measured | None

    def entries(self, robot: RobotConfig) -> Mapping[str, Measured]:
        """The values by their keys in robot.toml."""
        found = {}
        for port, ticks, offset in self._by_port(robot):
            found[f"motor.{port}.radians_per_tick"] = ticks
            if offset is not None:
                found[f"motor.{port}.bemf_offset"] = offset
        return found

    def applied(self, robot: RobotConfig) -> RobotConfig:
        """The robot with this calibration instead of its own."""
        motors = dict(robot.motors)
        for port, ticks, offset in self._by_port(robot):
            motor = motors.get(port, MotorConfig())
            offset = motor.bemf_offset if offset is None else offset
            motors[port] = replace(motor, radians_per_tick=ticks, bemf_offset=offset)
        return replace(robot, motors=motors)

    def _by_port(self, robot: RobotConfig) -> tuple[tuple[int, Measured, Measured | None], ...]:
        return (
            (robot.drive.left, self.left, self.left_offset),
            (robot.drive.right, self.right, self.right_offset),
        )
