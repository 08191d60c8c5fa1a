"""Sensor readings of the drive since the filter last moved, checked in every cycle and aligned in time."""

from __future__ import annotations

from dataclasses import dataclass

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Fault, Inputs
from raccoon.estimate.drive.estimate import AT_REST
from raccoon.estimate.drive.health import GYRO_TIMEOUT_S, GyroWatch, Reasons
from raccoon.estimate.drive.wheel_track import CYCLE_GAP_S, HOLD_S, WheelTrack
from raccoon.estimate.drive.wheels import LONGEST_GAP_S, MAX_TIME_S, WheelDecoder, WheelReading
from raccoon.estimate.drive.wiring import Wiring

COARSE_GYRO_PERIOD_S = 0.008
"""s between gyro readings above which a turn may begin or end unseen between two of them."""
KINK_SHARE = 0.15
"""Standard deviation of the mean rate between two coarse gyro readings, as a share of the second one's
deviation from a constant slope: a peak between them is cut off. A rate that rises evenly has none."""
SHARP_TURN_ACCELERATION = 30.0
"""rad/s2; a faster change of the turn rate, as at a wall, begins or ends between two readings, and its time
is known no better than their interval (`TURN_TIMING_SHARE` in stepper.py)."""
MAX_ACCELERATION = 400.0
"""m/s2, bound on a plausible reading; the accelerometers of these robots end at 16 g or less."""
MAX_PITCH_RATE = 3.0
"""rad/s, bound on a plausible reading; no robot on its wheels pitches or rolls faster."""
SILENT_WHEELS_WAIT_S = 0.5
"""s, longest time for which the filter waits for silent wheels while the gyro gives readings."""


@dataclass(slots=True)
class Pending:
    """What was read since the filter last moved: span (s), wheel angles (rad, nominal scale), the gyro's turn
    (rad) and the time that it covers (s)."""

    span: float = 0.0
    gap: bool = False
    """Whether a part of the span has no readings."""
    left: float = 0.0
    right: float = 0.0
    turn: float = 0.0
    gyro_span: float = 0.0
    gyro_count: int = 0
    gyro_kink_variance: float = 0.0
    """(rad/s)^2, variance of the gyro's mean because its rate did not run straight between readings."""
    gyro_sharp_turn: float = 0.0
    """rad, sum of the sharp jumps of the rate times the time between the two readings."""
    forward_accel_sum: float = 0.0
    """m/s2 forwards by the accelerometer, summed over its readings."""
    pitch_rate_sum: float = 0.0
    """rad/s about the axle by the gyro, summed over the same readings; positive: the nose goes down."""
    left_accel_sum: float = 0.0
    roll_rate_sum: float = 0.0
    """The same sums sideways: acceleration to the left, and the gyro's rate about the forward axis; positive:
    the left side goes up."""
    accel_count: int = 0
    faulty: bool = False
    """Whether the port reports a motor fault that may be a wheel's."""


class DriveReadings:
    """Wheels and gyro of a robot, cycle by cycle.

    pending: what the filter has not used yet.
    time: s, of the last cycle. gyro_rate: rad/s, the gyro's last reading.
    at_fault: whether a motor fault that the port reports may be a wheel's; set in a cycle with faults.
    """

    def __init__(self, robot: RobotConfig) -> None:
        lag = robot.model.bemf.filter_time_constant.value
        self.left, self.right = WheelTrack(lag), WheelTrack(lag)
        self.gyro, self.reasons, self.wiring = GyroWatch(), Reasons(), Wiring()
        self.gyro_rate = self._gyro_acceleration = 0.0  # rad/s, and its last slope, rad/s2
        self.time = 0.0
        self._has_time = False  # whether a cycle had a valid time
        self.at_fault = False
        self._decoder = WheelDecoder(robot)
        self._unseen_seconds = 0.0
        self._moves_at_rest = False  # reported by the port
        self._is_rest_motion_explained = False  # by a learnt offset
        self.clear()

    def clear(self) -> None:
        """Drop what is pending."""
        self.pending = Pending()

    def take(self, inputs: Inputs) -> bool:
        """Take a cycle. True if the filter may move: a gyro reading came, or none is to be expected."""
        reading = self._decoder.decode(inputs)
        self._moves_at_rest = Fault.BEMF_INVALID in inputs.faults and not _is_silent(reading)
        self._is_rest_motion_explained = self._is_rest_motion_explained and self._moves_at_rest
        fresh = False
        if reading.dt > 0.0:
            self.time = inputs.time
            self._take_wheels(reading.dt, reading, inputs)
            self._take_accelerometer(inputs)
            fresh = self._take_gyro(reading.dt, inputs) or self.gyro.age > GYRO_TIMEOUT_S
            if _is_empty(reading, inputs):  # a silent link: the missed time is bridged later, in one piece
                self._unseen_seconds += reading.dt
                fresh = False
            else:
                self._unseen_seconds = 0.0
            fresh = fresh and not self._is_waiting_for_wheels  # a gyro alone does not give the distance
        self._tell_faults(reading, inputs)
        if not self._has_time and -MAX_TIME_S <= inputs.time <= MAX_TIME_S:
            self._has_time, self.time = True, inputs.time
        return fresh

    def explain_rest_motion(self) -> None:
        """The robot stands: the wheels' readings are offsets, which the filter learns, so they need no report
        any more."""
        self._is_rest_motion_explained = self._moves_at_rest

    @property
    def _is_waiting_for_wheels(self) -> bool:
        """Whether both wheels have been silent for a while, but their counters may soon return."""
        return HOLD_S < min(self.left.silence, self.right.silence) <= SILENT_WHEELS_WAIT_S

    def _take_wheels(self, dt: float, reading: WheelReading, inputs: Inputs) -> None:
        left, right = self.left, self.right
        gap = (
            dt > CYCLE_GAP_S
            or self._unseen_seconds > HOLD_S
            or (self._is_waiting_for_wheels and not _is_silent(reading))
        )
        left.blind_time += dt * reading.left_blind
        right.blind_time += dt * reading.right_blind
        if reading.left_jumped:
            left.take_counter_jump(dt)
        if reading.right_jumped:
            right.take_counter_jump(dt)
        if inputs.faults and Fault.STALE in inputs.faults:
            # The speeds of a repeated frame are old; a counter that moved is new.
            left.update(dt, None, reading.left_angle, self._unseen_seconds)
            right.update(dt, None, reading.right_angle, self._unseen_seconds)
        else:
            left.update(dt, reading.left_speed, reading.left_angle, self._unseen_seconds)
            right.update(dt, reading.right_speed, reading.right_angle, self._unseen_seconds)
        pending = self.pending
        pending.span += dt
        pending.gap = pending.gap or gap
        pending.left += left.increment
        pending.right += right.increment

    def _take_gyro(self, dt: float, inputs: Inputs) -> bool:
        """Integrate the gyro by the trapezoidal rule. True if there is a new reading."""
        watch = self.gyro
        rate = watch.judge(dt, inputs, self.reasons)
        if rate is None:
            return False
        pending = self.pending
        before = rate if watch.age > GYRO_TIMEOUT_S else self.gyro_rate
        age = min(watch.age, pending.span)
        if age > GYRO_TIMEOUT_S:  # this reading says nothing about the time without readings
            self.gyro_rate, self._gyro_acceleration = rate, 0.0
            watch.age = 0.0
            return True
        pending.turn += 0.5 * (before + rate) * age
        pending.gyro_span += age
        pending.gyro_count += 1
        change = abs(rate - before)
        if age > COARSE_GYRO_PERIOD_S:
            pending.gyro_kink_variance += (
                KINK_SHARE * abs(rate - before - self._gyro_acceleration * age)
            ) ** 2
        if change > SHARP_TURN_ACCELERATION * age:
            pending.gyro_sharp_turn += (change - SHARP_TURN_ACCELERATION * age) * age
        self._gyro_acceleration = (rate - before) / age if age > 0.0 else 0.0
        self.gyro_rate = rate
        watch.age = 0.0
        return True

    def _take_accelerometer(self, inputs: Inputs) -> None:
        """Sum every reading: a blow is over within two."""
        if inputs.accel is None:
            return
        unit, pending = inputs.device.accel_m_s2, self.pending
        force, side = inputs.accel[0] * unit, inputs.accel[1] * unit
        if not (abs(force) < MAX_ACCELERATION and abs(side) < MAX_ACCELERATION):
            return
        pending.forward_accel_sum += force
        pending.left_accel_sum += side
        pending.accel_count += 1
        if inputs.gyro is None:
            return
        unit = inputs.device.gyro_rad_s
        roll, pitch = inputs.gyro[0] * unit, inputs.gyro[1] * unit
        if abs(pitch) < MAX_PITCH_RATE and abs(roll) < MAX_PITCH_RATE:
            pending.pitch_rate_sum += pitch
            pending.roll_rate_sum += roll

    def _tell_faults(self, reading: WheelReading, inputs: Inputs) -> None:
        """Report what is wrong with this cycle."""
        tell, time, reasons = self.reasons.tell, self.time, self.reasons
        reasons.drop_expired(time)
        if reading.dt <= 0.0 and inputs.time <= time and self._has_time:
            tell("time stands still or goes backwards", time)
        if reading.dt > CYCLE_GAP_S:
            more = "" if reading.dt < LONGEST_GAP_S else "more than "
            tell(f"{more}{reading.dt:.2f} s between two cycles", time, 0.5)
        if reading.not_a_number:
            tell("a wheel's reading is not a number", time)
        for side, jumped, absurd, wheel in (
            ("left", reading.left_jumped, reading.left_absurd, self.left),
            ("right", reading.right_jumped, reading.right_absurd, self.right),
        ):
            if jumped:
                tell(f"the {side} counter jumped", time)
            if absurd:
                tell(f"the {side} back-EMF is larger than any wheel's", time)
            if wheel.silence > HOLD_S:
                tell(f"the {side} wheel is silent", time)
            if wheel.stuck_source:
                tell(f"the {side} {wheel.stuck_source} does not move", time)
        if inputs.faults:
            for fault in inputs.faults:
                if fault is Fault.MOTOR_FAULT and not self.at_fault:
                    continue
                if fault is not Fault.BEMF_INVALID or not self._moves_at_rest:
                    tell(f"port: {fault.value}", time)
                elif not self._is_rest_motion_explained:
                    tell(AT_REST, time)
            self.pending.faulty = self.pending.faulty or self.at_fault


def _is_empty(reading: WheelReading, inputs: Inputs) -> bool:
    """Whether this cycle has neither a wheel's nor the gyro's reading."""
    return inputs.gyro is None and _is_silent(reading)


def _is_silent(reading: WheelReading) -> bool:
    """Whether this cycle has no wheel's reading."""
    speeds = reading.left_speed is None and reading.right_speed is None
    return speeds and reading.left_angle is None and reading.right_angle is None
