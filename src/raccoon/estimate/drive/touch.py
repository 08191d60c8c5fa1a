"""Whether the robot runs into something or pushes at it: the accelerometer against the wheels, and what the
wheels carry. And which wheel reads nothing although its motor is driven.
"""

from __future__ import annotations

from collections import deque

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Device, Fault, Inputs, Outputs
from raccoon.estimate.drive.bump import BUMP_TIME, BumpWatch
from raccoon.estimate.drive.estimate import HELD
from raccoon.estimate.drive.load import LoadWatch
from raccoon.estimate.drive.readings import COARSE_GYRO, DriveReadings, Pending
from raccoon.estimate.drive.slip import RESTING_SPEED
from raccoon.estimate.drive.wheel_track import HOLD
from raccoon.model.drive import DriveGeometry

COMES_BACK = 0.1
"""s after a wheel was silent in which its speed makes up for what was missed."""
UNNOTICED, ROLLS_OUT = 0.05, 0.3
"""s until a motor at fault is told of, and s at its speed before that a robot without power rolls at most."""
SPEEDS = 4
"""Steps of the filter, of which one is older than that."""
DRIVEN = 0.25
"""Duty that turns any motor: one that reads nothing under less may be the one that is not at fault."""
SLOW, LEAST_DUTY, USUAL_BATTERY = 0.4, 0.2, 6.6
"""Share of the V that a duty gives a motor, from such a duty and of such a battery, that its back-EMF has
where it turns freely. A port calls it at fault below 0.3, from a duty of 0.25."""
UNSEEN = 0.25
"""Of what a robot turns at most between two readings of the gyro as it runs into something, with one corner
that stands and the other wheel that goes on: deviation of what no reading tells."""
SETTLES = 0.5
"""s in which it runs into the same thing once."""


class Touch:
    """Tells in the readings' reasons what it finds. Feed it every step of the filter."""

    def __init__(self, robot: RobotConfig, readings: DriveReadings) -> None:
        self._left, self._right = readings.left, readings.right
        self._readings = readings
        self._radius = robot.model.drive.wheel_radius.value
        self._half_radius = 0.5 * self._radius
        self._wheels_a_turn = DriveGeometry.from_robot(robot).track_width / self._radius
        self._ports = robot.drive.left, robot.drive.right
        self._signs = tuple(-0.5 if robot.motor(port).inverted else 0.5 for port in self._ports)
        self._duty = self._jolt = 0.0  # of both wheels ahead, and by how much it changed at once lately
        self._driven = self.mute = (False, False)
        self._bump, self._side = BumpWatch(), BumpWatch()
        self._load = LoadWatch(robot, SIMULATOR)
        self._unseen = 0.0
        self.pushed = self.pushed_aside = 0.0
        """m^2 that the next step adds to the doubt about the place, ahead and to the side, as something
        pushed the robot in this one."""
        self._speeds = deque([0.0], SPEEDS)  # m/s ahead in the last steps without a fault
        self._rolled = self._way = 0.0  # s and m since there is one
        self._meets, self._met = False, SETTLES  # something, and s since it did first

    def configure(self, device: Device) -> None:
        """Words of this device follow."""
        self._load.configure(device)

    def drive(self, inputs: Inputs, command: Outputs | None) -> None:
        """A cycle, read while `command` was in force (None: not known)."""
        self._load.drive(inputs, command)
        left, right = self._ports
        if inputs.faults:
            slow = any(_is_slow(inputs, command, port) for port in self._ports)
            self._readings.at_fault = slow and Fault.MOTOR_FAULT in inputs.faults
        self._driven = (
            (True, True)
            if command is None
            else (abs(command.duty[left]) >= DRIVEN, abs(command.duty[right]) >= DRIVEN)
        )
        if command is not None:
            before = self._duty
            self._duty = self._signs[0] * command.duty[left] + self._signs[1] * command.duty[right]
            self._jolt = max(self._jolt, abs(self._duty - before))

    def interrupt(self, velocity: float, turn_rate: float) -> None:
        """Nobody looked for a while; the robot goes at `velocity` m/s and turns at `turn_rate` rad/s now."""
        self._interrupt_felt(velocity, turn_rate)
        self._load.interrupt()

    def _interrupt_felt(self, velocity: float, turn_rate: float) -> None:
        self._bump.interrupt(velocity, turn_rate)
        self._side.interrupt(0.0, turn_rate)

    def feel(self, pending: Pending, still: bool) -> None:
        """Compare the accelerometer with the wheels, over a step. still: the robot stands."""
        self.pushed = self.pushed_aside = 0.0
        if pending.force_count == 0:
            return
        span, count = pending.span, pending.force_count
        self._unseen = COMES_BACK if self._silent else self._unseen - span
        velocity = self._half_radius * (self._left.mean + self._right.mean)
        turn_rate = (self._right.mean - self._left.mean) / self._wheels_a_turn
        if self._unseen > 0.0:
            self._interrupt_felt(velocity, turn_rate)
            return
        ahead, side, every = self._bump, self._side, span / count
        sideways = pending.side / count - velocity * turn_rate  # without that of the bend
        forward, pitch_rate, jolt = pending.force / count, pending.pitch / count, self._jolt
        struck = ahead.update(span, forward, velocity, still, every, pitch_rate, turn_rate, jolt)
        self._jolt *= max(0.0, 1.0 - span / BUMP_TIME)
        if side.update(span, sideways, 0.0, still, every, -pending.roll / count, turn_rate) or struck:
            self._meets = True
            self.pushed, self.pushed_aside = ahead.doubt, side.doubt
            self._readings.reasons.tell(
                "bumped: the wheels do not move as the robot does", self._readings.time
            )

    def carries(self, span: float, left: float, right: float) -> float:
        """m^2 that a step of `span` s adds to the doubt about the place, because the wheels carry too much.

        left, right: rad/s of the wheels, without their offsets.
        """
        if not (self._left.fine and self._right.fine) or self._silent:
            self._load.interrupt()
            return 0.0
        self._load.update(span, left, right)
        if self._load.held:
            self._meets = True
            self._readings.reasons.tell(HELD, self._readings.time)
        return self._load.doubt

    def turned_unseen(self, span: float, between: float) -> float:
        """rad, deviation of what the robot turned in this step of `span` s and no reading of the gyro tells:
        it has just run into something, and they are `between` s apart.
        """
        first = self._meets and self._met >= SETTLES
        self._met = 0.0 if self._meets else min(self._met + span, SETTLES)
        self._meets = False
        if not first or between <= COARSE_GYRO:
            return 0.0
        return UNSEEN * between * max(self._speeds) / (0.5 * self._wheels_a_turn * self._radius)

    def listen(self, left: float, right: float, faulty: bool) -> None:
        """Find out which wheel is `mute`, left and right: a motor at fault (faulty: there is one) is driven
        and its wheel reads nothing, until it reads something again.

        It stands where it is blocked. Where its plug or fuse is open or its converter is dead it does not,
        and the gyro and the other wheel tell how fast it turns. So nothing is taken of one that is mute
        alone; of two, the robot is blocked more likely. left, right: rad/s of the wheels, without offsets.
        """
        before, driven = self.mute, self._driven
        self.mute = (
            (before[0] or (faulty and driven[0])) and abs(left) < RESTING_SPEED,
            (before[1] or (faulty and driven[1])) and abs(right) < RESTING_SPEED,
        )

    def rolls(self, span: float, left: float, right: float, turn: float | None) -> float:
        """m^2 that a step of `span` s adds to the doubt about the place, because a wheel is mute.

        One that rolls on by the gyro and the other wheel may be blocked all the same, with the other one
        spinning. Two of them read 0 where they are blocked, and also where the robot rolls on without power.
        left, right: rad/s of the wheels, without their offsets. turn: rad/s of the robot, None where no gyro
        tells.
        """
        if not any(self.mute):
            self._rolled = self._way = 0.0
            self._speeds.append(abs(self._half_radius * (left + right)))
            return 0.0
        before = self._way
        if self._rolled == 0.0:
            self._way = UNNOTICED * max(self._speeds)
            self._rolled = UNNOTICED
        if all(self.mute) or turn is None:
            seconds = min(span, ROLLS_OUT - self._rolled)
            self._way += seconds * max(self._speeds)
            self._rolled += seconds
        else:
            unread = abs(right - left - self._wheels_a_turn * turn)
            self._way += span * self._radius * unread
            if unread > RESTING_SPEED:
                side = "left" if self.mute[0] else "right"
                self._readings.reasons.tell(f"the {side} wheel reads nothing", self._readings.time)
        return self._way * self._way - before * before

    @property
    def held_way(self) -> float:
        """See LoadWatch."""
        return self._load.held_way

    @property
    def _silent(self) -> bool:
        return max(self._left.silent, self._right.silent) > HOLD


def _is_slow(inputs: Inputs, command: Outputs | None, port: int) -> bool:
    """Whether the motor on `port` may be the one that is at fault, which no port says: it is driven, and does
    not turn as it would. An arm at its stop is no doubt about the pose.
    """
    if command is None:
        return True
    duty, word = command.duty[port], inputs.bemf[port]
    if -LEAST_DUTY < duty < LEAST_DUTY:
        return False
    return word is None or word * inputs.device.bemf_volts / duty < SLOW * USUAL_BATTERY
