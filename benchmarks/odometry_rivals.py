"""What the odometry is compared with, on the same readings: three simpler schemes behind one method.

`update(inputs)` gives (x, y, heading); `place` sets the pose. None of them carries an uncertainty.
"""

from __future__ import annotations

import math
from typing import Protocol

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Inputs, Outputs
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.drive.wheels import WheelDecoder, WheelReading
from raccoon.model.drive import DriveGeometry, arc_end

Pose = tuple[float, float, float]


class Estimator(Protocol):
    """Anything that says where the robot is."""

    def update(self, inputs: Inputs, command: Outputs) -> Pose:
        """Take a cycle."""
        ...

    def place(self, pose: Pose) -> None:
        """Take the pose to be known."""
        ...


class Ours:
    """This library's filter."""

    def __init__(self, robot: RobotConfig) -> None:
        self.odometry = Odometry(robot)

    def update(self, inputs: Inputs, command: Outputs) -> Pose:
        estimate = self.odometry.update(inputs, command)
        return estimate.x, estimate.y, estimate.heading

    def place(self, pose: Pose) -> None:
        self.odometry.reset(*pose)


class _Wheels:
    """Wheel angles since the last cycle: the counter's increment, or back-EMF times time."""

    def __init__(self, robot: RobotConfig) -> None:
        self.geometry = DriveGeometry.from_robot(robot)
        self._decoder = WheelDecoder(robot)
        self.pose: Pose = (0.0, 0.0, 0.0)

    def place(self, pose: Pose) -> None:
        self.pose = pose

    def turned(self, inputs: Inputs) -> tuple[float, float, WheelReading]:
        reading = self._decoder.decode(inputs)
        left = (
            reading.left_angle if reading.left_angle is not None else (reading.left_speed or 0.0) * reading.dt
        )
        right = (
            reading.right_angle
            if reading.right_angle is not None
            else (reading.right_speed or 0.0) * reading.dt
        )
        return left, right, reading


class DeadReckoning(_Wheels):
    """Plain dead reckoning: position and heading from the wheels."""

    def update(self, inputs: Inputs, _: Outputs) -> Pose:
        left, right = self.turned(inputs)[:2]
        self.pose = arc_end(*self.pose, *self.geometry.body_motion(left, right))
        return self.pose


class RuleBased(_Wheels):
    """Heading from the IMU alone, way from the wheels, and a rule for slip: no states, no uncertainty.

    The rule, as the scheme is described: where the wheels' turn disagrees with the IMU's by more than a
    third of the wheels' speed difference at full speed, the wheel that reads more than it can have rolled
    is replaced by what the other wheel and the IMU say.
    """

    SLIP_TURN = 0.8
    """rad/s of disagreement."""

    def update(self, inputs: Inputs, _: Outputs) -> Pose:
        left, right, reading = self.turned(inputs)
        travel, wheel_turn = self.geometry.body_motion(left, right)
        rate = inputs.turn_rate
        if rate is None or reading.dt <= 0.0:
            self.pose = arc_end(*self.pose, travel, wheel_turn)
            return self.pose
        turn = rate * reading.dt
        if abs(wheel_turn - turn) > self.SLIP_TURN * reading.dt:
            radius, side = self.geometry.wheel_radius, 0.5 * turn * self.geometry.track_width
            from_left, from_right = left * radius + side, right * radius - side
            travel = min(from_left, from_right, key=abs)
        self.pose = arc_end(*self.pose, travel, turn)
        return self.pose


class Wpimath(_Wheels):
    """`DifferentialDrivePoseEstimator` of robotpy-wpimath: wheel ways and a gyro angle."""

    def __init__(self, robot: RobotConfig) -> None:
        super().__init__(robot)
        from wpimath.estimator import DifferentialDrivePoseEstimator
        from wpimath.geometry import Pose2d, Rotation2d
        from wpimath.kinematics import DifferentialDriveKinematics

        self._rotation, self._pose2d = Rotation2d, Pose2d
        kinematics = DifferentialDriveKinematics(self.geometry.track_width)
        self._estimator = DifferentialDrivePoseEstimator(kinematics, Rotation2d(), 0.0, 0.0, Pose2d())
        self._left = self._right = self._angle = self._heading = 0.0

    def place(self, pose: Pose) -> None:
        self._estimator.resetPosition(
            self._rotation(self._angle),
            self._left,
            self._right,
            self._pose2d(*pose[:2], self._rotation(pose[2])),
        )
        self._heading = pose[2]

    def update(self, inputs: Inputs, _: Outputs) -> Pose:
        left, right, reading = self.turned(inputs)
        self._left += left * self.geometry.wheel_radius
        self._right += right * self.geometry.wheel_radius
        rate = inputs.turn_rate
        turn = self.geometry.body_motion(left, right)[1] if rate is None else rate * reading.dt
        self._angle += turn
        pose = self._estimator.updateWithTime(
            inputs.time, self._rotation(self._angle), self._left, self._right
        )
        wrapped = pose.rotation().radians()
        self._heading += math.remainder(wrapped - self._heading, 2 * math.pi)
        return pose.X(), pose.Y(), self._heading


SCHEMES: dict[str, type] = {
    "this filter": Ours,
    "dead reckoning": DeadReckoning,
    "rule-based": RuleBased,
    "wpimath": Wpimath,
}
