"""Whether the robot runs into something or pushes at it: the accelerometer against the wheels, and what the
wheels carry.
"""

from __future__ import annotations

from collections import deque

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Device, Inputs, Outputs
from raccoon.estimate.drive.estimate import HELD
from raccoon.estimate.drive.load import LoadWatch
from raccoon.estimate.drive.readings import DriveReadings, Pending
from raccoon.estimate.drive.slip import BumpWatch
from raccoon.estimate.drive.wheel_track import HOLD

COMES_BACK = 0.1
"""s after a wheel was silent in which its speed makes up for what was missed."""
UNNOTICED, ROLLS_OUT = 0.05, 0.3
"""s until a motor at fault is told of, and s at its speed before that a robot without power rolls at most."""
SPEEDS = 4
"""Steps of the filter, of which one is older than that."""


class Touch:
    """Tells in the readings' reasons what it finds. Feed it every step of the filter."""

    def __init__(self, robot: RobotConfig, readings: DriveReadings) -> None:
        self._left, self._right = readings.left, readings.right
        self._readings = readings
        self._half_radius = 0.5 * robot.model.drive.wheel_radius.value
        self._bump = BumpWatch()
        self._load = LoadWatch(robot, SIMULATOR)
        self._unseen = 0.0
        self._speeds = deque([0.0], SPEEDS)  # m/s ahead in the last steps without a fault
        self._rolled = self._way = 0.0  # s and m since there is one

    def configure(self, device: Device) -> None:
        """Words of this device follow."""
        self._load.configure(device)

    def drive(self, inputs: Inputs, command: Outputs | None) -> None:
        """A cycle, read while `command` was in force (None: not known)."""
        self._load.drive(inputs, command)

    def interrupt(self, velocity: float) -> None:
        """Nobody looked for a while; the robot goes at `velocity` m/s now."""
        self._bump.interrupt(velocity)
        self._load.interrupt()

    def feel(self, pending: Pending, still: bool) -> None:
        """Compare the accelerometer with the wheels, over a step. still: the robot stands."""
        if pending.force_count == 0:
            return
        span, count = pending.span, pending.force_count
        forward, pitch_rate = pending.force / count, pending.pitch / count
        self._unseen = COMES_BACK if self._silent else self._unseen - span
        velocity = self._half_radius * (self._left.mean + self._right.mean)
        if self._unseen > 0.0:
            self._bump.interrupt(velocity)
        elif self._bump.update(span, forward, velocity, still, span / count, pitch_rate):
            self._readings.reasons.tell(
                "bumped: the wheels do not move as the robot does", self._readings.time
            )

    def carries(self, span: float, left: float, right: float) -> float:
        """M^2 that a step of `span` s adds to the doubt about the place, because the wheels carry too much.

        left, right: rad/s of the wheels, without their offsets.
        """
        if not (self._left.fine and self._right.fine) or self._silent:
            self._load.interrupt()
            return 0.0
        self._load.update(span, left, right)
        if self._load.held:
            self._readings.reasons.tell(HELD, self._readings.time)
        return self._load.doubt

    def rolls(self, span: float, left: float, right: float, faulty: bool) -> float:
        """M^2 that a step of `span` s adds to the doubt about the place, because a motor is at fault.

        It reads 0 where it is blocked, and also where its plug or fuse is open: then the robot rolls on.
        left, right: rad/s of the wheels, without their offsets.
        """
        if not faulty:
            self._rolled = self._way = 0.0
            self._speeds.append(abs(self._half_radius * (left + right)))
            return 0.0
        seconds = min(span if self._rolled > 0.0 else span + UNNOTICED, ROLLS_OUT - self._rolled)
        before = self._way
        self._rolled += seconds
        self._way += seconds * max(self._speeds)
        return self._way * self._way - before * before

    @property
    def held_way(self) -> float:
        """See LoadWatch."""
        return self._load.held_way

    @property
    def _silent(self) -> bool:
        return max(self._left.silent, self._right.silent) > HOLD
