"""Whether the robot runs into something or pushes at it: the accelerometer against the wheels, and what the
wheels carry. And which wheel reads nothing although its motor is driven.
"""

from __future__ import annotations

from collections import deque

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, Device, Fault, Inputs, Outputs
from raccoon.estimate.drive.bump import BUMP_TIME_S, BumpWatch
from raccoon.estimate.drive.estimate import HELD
from raccoon.estimate.drive.load import LoadWatch
from raccoon.estimate.drive.readings import COARSE_GYRO_PERIOD_S, DriveReadings, Pending
from raccoon.estimate.drive.slip import RESTING_SPEED
from raccoon.estimate.drive.wheel_track import HOLD_S
from raccoon.model.drive import DriveGeometry

CATCH_UP_S = 0.1
"""s after a wheel was silent in which its speed makes up for what was missed."""
FAULT_DELAY_S, ROLL_OUT_S = 0.05, 0.3
"""s until a motor at fault is told of, and s at its speed before that a robot without power rolls at most."""
KEPT_SPEEDS = 4
"""Steps of the filter, of which one is older than that."""
DRIVEN_DUTY = 0.25
"""Duty that turns any motor: one that reads nothing under less may be the one that is not at fault."""
SLOW_SHARE, MIN_DUTY, USUAL_BATTERY_V = 0.4, 0.2, 6.6
"""Share of the V that a duty gives a motor, from such a duty and of such a battery, that its back-EMF has
where it turns freely. A port calls it at fault below 0.3, from a duty of 0.25."""
UNSEEN_TURN_SHARE = 0.25
"""Of what a robot turns at most between two readings of the gyro as it runs into something, with one corner
that stands and the other wheel that goes on: deviation of what no reading tells."""
SAME_CONTACT_S = 0.5
"""s in which it runs into the same thing once."""


class ContactMonitor:
    """Tells in the readings' reasons what it finds. Feed it every step of the filter."""

    def __init__(self, robot: RobotConfig, readings: DriveReadings) -> None:
        self._left, self._right = readings.left, readings.right
        self._readings = readings
        self._radius = robot.model.drive.wheel_radius.value
        self._half_radius = 0.5 * self._radius
        self._track_in_radii = DriveGeometry.from_robot(robot).track_width / self._radius
        self._ports = robot.drive.left, robot.drive.right
        self._half_signs = tuple(-0.5 if robot.motor(port).inverted else 0.5 for port in self._ports)
        self._duty = self._duty_jump = 0.0  # of both wheels ahead, and by how much it changed at once lately
        self._driven = self.mute = (False, False)
        self._forward_bump, self._side_bump = BumpWatch(), BumpWatch()
        self._load = LoadWatch(robot, SIMULATOR)
        self._catch_up_left = 0.0
        self.pushed_along_variance = self.pushed_across_variance = 0.0
        """m^2 that the next step adds to the doubt about the place, ahead and to the side, as something
        pushed the robot in this one."""
        self._speeds = deque([0.0], KEPT_SPEEDS)  # m/s ahead in the last steps without a fault
        self._mute_seconds = self._mute_way = 0.0  # s and m since there is one
        self._is_in_contact = False
        self._seconds_since_contact = SAME_CONTACT_S  # since it touched something first

    def configure(self, device: Device) -> None:
        """Words of this device follow."""
        self._load.configure(device)

    def take_command(self, inputs: Inputs, command: Outputs | None) -> None:
        """A cycle, read while `command` was in force (None: not known)."""
        self._load.take_command(inputs, command)
        left, right = self._ports
        if inputs.faults:
            slow = any(_is_slow(inputs, command, port) for port in self._ports)
            self._readings.at_fault = slow and Fault.MOTOR_FAULT in inputs.faults
        self._driven = (
            (True, True)
            if command is None
            else (abs(command.duty[left]) >= DRIVEN_DUTY, abs(command.duty[right]) >= DRIVEN_DUTY)
        )
        if command is not None:
            before = self._duty
            self._duty = self._half_signs[0] * command.duty[left] + self._half_signs[1] * command.duty[right]
            self._duty_jump = max(self._duty_jump, abs(self._duty - before))

    def restart(self, velocity: float, turn_rate: float) -> None:
        """Nobody looked for a while; the robot goes at `velocity` m/s and turns at `turn_rate` rad/s now."""
        self._restart_bump_watches(velocity, turn_rate)
        self._load.restart()

    def _restart_bump_watches(self, velocity: float, turn_rate: float) -> None:
        self._forward_bump.restart(velocity, turn_rate)
        self._side_bump.restart(0.0, turn_rate)

    def detect_bump(self, pending: Pending, still: bool) -> None:
        """Compare the accelerometer with the wheels, over a step. still: the robot stands."""
        self.pushed_along_variance = self.pushed_across_variance = 0.0
        if pending.accel_count == 0:
            return
        span, count = pending.span, pending.accel_count
        self._catch_up_left = CATCH_UP_S if self._is_wheel_silent else self._catch_up_left - span
        velocity = self._half_radius * (self._left.step_speed + self._right.step_speed)
        turn_rate = (self._right.step_speed - self._left.step_speed) / self._track_in_radii
        if self._catch_up_left > 0.0:
            self._restart_bump_watches(velocity, turn_rate)
            return
        forward_bump, side_bump, sample_period = self._forward_bump, self._side_bump, span / count
        sideways = pending.left_accel_sum / count - velocity * turn_rate  # without that of the bend
        forward, pitch_rate = pending.forward_accel_sum / count, pending.pitch_rate_sum / count
        jolt = self._duty_jump
        was_struck = forward_bump.update(
            span, forward, velocity, still, sample_period, pitch_rate, turn_rate, jolt
        )
        self._duty_jump *= max(0.0, 1.0 - span / BUMP_TIME_S)
        if (
            side_bump.update(
                span, sideways, 0.0, still, sample_period, -pending.roll_rate_sum / count, turn_rate
            )
            or was_struck
        ):
            self._is_in_contact = True
            self.pushed_along_variance = forward_bump.place_variance
            self.pushed_across_variance = side_bump.place_variance
            self._readings.reasons.tell(
                "bumped: the wheels do not move as the robot does", self._readings.time
            )

    def along_variance(self, span: float, left: float, right: float, turn: float | None) -> float:
        """m^2 that a step of `span` s adds to the doubt about the place ahead: of load, of mute wheels, and
        of what pushed the robot in the step before. left, right, turn: as for `mute_variance`."""
        found = self.load_variance(span, left, right) + self.mute_variance(span, left, right, turn)
        return found + self.pushed_along_variance

    def load_variance(self, span: float, left: float, right: float) -> float:
        """m^2 that a step of `span` s adds to the doubt about the place, because the wheels carry too much.

        left, right: rad/s of the wheels, without their offsets.
        """
        if not (self._left.has_bemf and self._right.has_bemf) or self._is_wheel_silent:
            self._load.restart()
            return 0.0
        self._load.update(span, left, right)
        if self._load.held:
            self._is_in_contact = True
            self._readings.reasons.tell(HELD, self._readings.time)
        return self._load.place_variance

    def unseen_turn_std(self, span: float, gyro_period: float) -> float:
        """rad, deviation of what the robot turned in this step of `span` s and no reading of the gyro tells:
        it has just run into something, and they are `between` s apart.
        """
        first = self._is_in_contact and self._seconds_since_contact >= SAME_CONTACT_S
        self._seconds_since_contact = (
            0.0 if self._is_in_contact else min(self._seconds_since_contact + span, SAME_CONTACT_S)
        )
        self._is_in_contact = False
        if not first or gyro_period <= COARSE_GYRO_PERIOD_S:
            return 0.0
        return (
            UNSEEN_TURN_SHARE * gyro_period * max(self._speeds) / (0.5 * self._track_in_radii * self._radius)
        )

    def find_mute_wheels(self, left: float, right: float, faulty: bool) -> None:
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

    def mute_variance(self, span: float, left: float, right: float, turn: float | None) -> float:
        """m^2 that a step of `span` s adds to the doubt about the place, because a wheel is mute.

        One that rolls on by the gyro and the other wheel may be blocked all the same, with the other one
        spinning. Two of them read 0 where they are blocked, and also where the robot rolls on without power.
        left, right: rad/s of the wheels, without their offsets. turn: rad/s of the robot, None where no gyro
        tells.
        """
        if not any(self.mute):
            self._mute_seconds = self._mute_way = 0.0
            self._speeds.append(abs(self._half_radius * (left + right)))
            return 0.0
        way_before = self._mute_way
        if self._mute_seconds == 0.0:
            self._mute_way = FAULT_DELAY_S * max(self._speeds)
            self._mute_seconds = FAULT_DELAY_S
        if all(self.mute) or turn is None:
            seconds = min(span, ROLL_OUT_S - self._mute_seconds)
            self._mute_way += seconds * max(self._speeds)
            self._mute_seconds += seconds
        else:
            unread_speed = abs(right - left - self._track_in_radii * turn)
            self._mute_way += span * self._radius * unread_speed
            if unread_speed > RESTING_SPEED:
                side = "left" if self.mute[0] else "right"
                self._readings.reasons.tell(f"the {side} wheel reads nothing", self._readings.time)
        return self._mute_way * self._mute_way - way_before * way_before

    @property
    def held_way(self) -> float:
        """See LoadWatch."""
        return self._load.held_way

    @property
    def _is_wheel_silent(self) -> bool:
        return max(self._left.silence, self._right.silence) > HOLD_S


def _is_slow(inputs: Inputs, command: Outputs | None, port: int) -> bool:
    """Whether the motor on `port` may be the one that is at fault, which no port says: it is driven, and does
    not turn as it would. An arm at its stop is no doubt about the pose.
    """
    if command is None:
        return True
    duty, word = command.duty[port], inputs.bemf[port]
    if -MIN_DUTY < duty < MIN_DUTY:
        return False
    return word is None or word * inputs.device.bemf_volts / duty < SLOW_SHARE * USUAL_BATTERY_V
