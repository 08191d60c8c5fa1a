"""Detection of contact (the robot runs into something or pushes against it), from the accelerometer compared
with the wheels and from the wheels' load; and of a wheel whose motor is driven but gives no reading."""

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
"""s after a wheel was silent in which bumps are not detected, because its speed catches up with what was
missed."""
FAULT_DELAY_S, ROLL_OUT_S = 0.05, 0.3
"""s from a motor's fault to its report, and the longest time, s, for which a robot without power rolls on at
its previous speed."""
KEPT_SPEEDS = 4
"""Number of filter steps whose speeds are kept, so that one is older than FAULT_DELAY_S."""
DRIVEN_DUTY = 0.25
"""Duty that turns any motor. A motor without a reading at a smaller duty need not be the one at fault."""
SLOW_SHARE, MIN_DUTY, USUAL_BATTERY_V = 0.4, 0.2, 6.6
"""Bound on the back-EMF, as a share of the voltage that a duty applies, below which a driven motor may be the
one at fault; smallest such duty; and battery voltage assumed, V. A port reports a fault below a share of 0.3,
from a duty of 0.25."""
UNSEEN_TURN_SHARE = 0.25
"""Standard deviation of the turn between two gyro readings that neither shows as the robot runs into
something, as a share of the largest possible turn: one corner stops and the other wheel goes on."""
SAME_CONTACT_S = 0.5
"""s within which further contact counts as the same contact."""


class ContactMonitor:
    """Adds its findings to the reasons of the readings. Feed it every step of the filter."""

    def __init__(self, robot: RobotConfig, readings: DriveReadings) -> None:
        self._left, self._right = readings.left, readings.right
        self._readings = readings
        self._radius = robot.model.drive.wheel_radius.value
        self._half_radius = 0.5 * self._radius
        self._track_in_radii = DriveGeometry.from_robot(robot).track_width / self._radius
        self._ports = robot.drive.left, robot.drive.right
        self._half_signs = tuple(-0.5 if robot.motor(port).inverted else 0.5 for port in self._ports)
        self._duty = self._duty_jump = 0.0  # mean duty forwards of both wheels, and its largest recent jump
        self._driven = self.mute = (False, False)
        self._forward_bump, self._side_bump = BumpWatch(), BumpWatch()
        self._load = LoadWatch(robot, SIMULATOR)
        self._catch_up_left = 0.0
        self.pushed_along_variance = self.pushed_across_variance = 0.0
        """m^2 that the next step adds to the variance of the position, forwards and sideways, because
        something pushed the robot in this one."""
        self._speeds = deque([0.0], KEPT_SPEEDS)  # m/s forwards in the last steps without a fault
        self._mute_seconds = self._mute_way = 0.0  # duration (s) and distance (m) of the present mute phase
        self._is_in_contact = False
        self._seconds_since_contact = SAME_CONTACT_S  # since contact began

    def configure(self, device: Device) -> None:
        """Set the device that the following words come from."""
        self._load.configure(device)

    def take_command(self, inputs: Inputs, command: Outputs | None) -> None:
        """Take a cycle that was read while `command` was in force (None: unknown)."""
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
        """Start again after a gap in the readings, at the present velocity (m/s) and turn rate (rad/s)."""
        self._restart_bump_watches(velocity, turn_rate)
        self._load.restart()

    def _restart_bump_watches(self, velocity: float, turn_rate: float) -> None:
        self._forward_bump.restart(velocity, turn_rate)
        self._side_bump.restart(0.0, turn_rate)

    def detect_bump(self, pending: Pending, still: bool) -> None:
        """Compare the accelerometer with the wheels over a step. still: the robot stands."""
        self.pushed_along_variance = self.pushed_across_variance = 0.0
        span, count, jolt = pending.span, pending.accel_count, self._duty_jump
        self._duty_jump *= max(0.0, 1.0 - span / BUMP_TIME_S)
        self._catch_up_left = CATCH_UP_S if self._is_wheel_silent else self._catch_up_left - span
        velocity = self._half_radius * (self._left.step_speed + self._right.step_speed)
        turn_rate = (self._right.step_speed - self._left.step_speed) / self._track_in_radii
        if count == 0 or self._catch_up_left > 0.0:
            # Otherwise the change of speed that was not felt would look like a bump afterwards.
            self._restart_bump_watches(velocity, turn_rate)
            return
        forward_bump, side_bump, sample_period = self._forward_bump, self._side_bump, span / count
        sideways = pending.left_accel_sum / count - velocity * turn_rate  # less the centripetal acceleration
        forward, pitch_rate = pending.forward_accel_sum / count, pending.pitch_rate_sum / count
        was_struck = forward_bump.update(
            span, forward, velocity, still, sample_period, pitch_rate, turn_rate, jolt
        )
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
        """m^2 that a step of `span` s adds to the variance of the position along the heading: because of
        load, of mute wheels, and of a push in the step before. left, right, turn: as for `mute_variance`."""
        found = self.load_variance(span, left, right) + self.mute_variance(span, left, right, turn)
        return found + self.pushed_along_variance

    def load_variance(self, span: float, left: float, right: float) -> float:
        """m^2 that a step of `span` s adds to the variance of the position, because the load is too high.

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
        """rad, standard deviation of the turn in this step of `span` s that no gyro reading shows, because
        the robot has just run into something; 0 otherwise. gyro_period: s between two gyro readings."""
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
        """Update `mute`, left and right: whether a wheel reads nothing while its motor is driven and a motor
        fault is reported (faulty). It stays mute until it reads something again.

        Such a wheel stands if it is blocked. It may turn if its plug or fuse is open or its converter is
        dead; then the gyro and the other wheel show its speed. So the reading of a single mute wheel is not
        used; if both are mute, a blocked robot is more likely. left, right: rad/s of the wheels, without
        offsets.
        """
        before, driven = self.mute, self._driven
        self.mute = (
            (before[0] or (faulty and driven[0])) and abs(left) < RESTING_SPEED,
            (before[1] or (faulty and driven[1])) and abs(right) < RESTING_SPEED,
        )

    def mute_variance(self, span: float, left: float, right: float, turn: float | None) -> float:
        """m^2 that a step of `span` s adds to the variance of the position because a wheel is mute.

        A mute wheel that seems to roll on, by gyro and other wheel, may be blocked while the other one spins.
        Two mute wheels read 0 both when blocked and when the robot rolls on without power. left, right: rad/s
        of the wheels, without their offsets. turn: turn rate of the robot, rad/s; None without a gyro.
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
        """See `LoadWatch.held_way`."""
        return self._load.held_way

    @property
    def _is_wheel_silent(self) -> bool:
        return max(self._left.silence, self._right.silence) > HOLD_S


def _is_slow(inputs: Inputs, command: Outputs | None, port: int) -> bool:
    """Whether the motor on `port` may be the one at fault (a port reports a fault without naming the motor):
    it is driven and turns too slowly for its duty. An arm at its stop does not make the pose uncertain."""
    if command is None:
        return True
    duty, word = command.duty[port], inputs.bemf[port]
    if -MIN_DUTY < duty < MIN_DUTY:
        return False
    return word is None or word * inputs.device.bemf_volts / duty < SLOW_SHARE * USUAL_BATTERY_V
