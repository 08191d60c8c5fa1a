"""Assembly of each step of the drive filter from the readings since the last one."""

from __future__ import annotations

from math import hypot, sqrt

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device, Outputs
from raccoon.estimate.drive.contact import ContactMonitor
from raccoon.estimate.drive.filter_step import RestDoubt, StepReading
from raccoon.estimate.drive.fusion import Fusion
from raccoon.estimate.drive.health import GYRO_TIMEOUT_S, SUSPICIOUS_REPEATS
from raccoon.estimate.drive.noise import WheelNoise
from raccoon.estimate.drive.prior import prior, process_noise
from raccoon.estimate.drive.readings import DriveReadings, Pending
from raccoon.estimate.drive.standstill import (
    CREEP_TIME_S,
    OTHER_BIAS_MARGIN,
    CreepDetector,
    StandstillDetector,
    does_offset_explain,
)
from raccoon.estimate.drive.timing import GYRO_SHAKING_SHARE, Shaking, TurnAcceleration
from raccoon.estimate.drive.turn_share import TurnShare
from raccoon.estimate.drive.wheel_track import HOLD_S
from raccoon.estimate.drive.wheels import known_offset_speeds, lag_seconds
from raccoon.estimate.ekf.filter import DriveFilter, variance_index
from raccoon.estimate.ekf.state import OdometrySettings, State
from raccoon.model.bemf import counts_scale
from raccoon.model.drive import DriveGeometry

TURN_TIMING_SHARE = 1.2
"""Standard deviation of the time at which the turn rate jumped by more than
`readings.SHARP_TURN_ACCELERATION`, as a share of the time between two gyro readings. The turn is still the
gyro's: wheels slip in such a moment, which is worse."""
GYRO_RATE_HZ = 100.0
"""Hz, maximum rate of gyro readings with independent noise: the chip's filter of 41 Hz correlates more
frequent ones."""
REST_TIMING_S = 0.05
"""s, standard deviation of the time at which a robot that seems to creep came to rest."""
BIAS_HEADING_SHARE, BIAS_PLACE_SHARE = 0.29, 0.25
"""Standard deviations after the gyro's bias changed at an unknown time since the robot last stood. Of the
heading: as a share of the angle that the change of bias makes in that time. Of the position: as a share of
this angle times the distance; it is across the path, half of that, and half again because of the unknown
time."""
TURN_MISMATCH = "the robot turns differently from its wheels"
_VB = variance_index(State.GYRO_BIAS)
_VOL, _VOR = variance_index(State.LEFT_OFFSET), variance_index(State.RIGHT_OFFSET)


class FilterStepper:
    """Moves the filter on, and feeds each step to the detectors that watch the drive.

    fusion: the filter with its kept steps, a new one for each device. contact, turn_share: detectors that
    were fed everything so far.
    """

    def __init__(
        self, robot: RobotConfig, settings: OdometrySettings, readings: DriveReadings, device: Device
    ) -> None:
        self._robot = robot
        self._settings = settings
        self._geometry = DriveGeometry.from_robot(robot)
        self._ports = (robot.drive.left, robot.drive.right)
        self._readings = readings
        self._left, self._right = readings.left, readings.right
        self._gyro, self._reasons = readings.gyro, readings.reasons
        self._turn_acceleration, self._shaking = TurnAcceleration(), Shaking()
        self._standstill = StandstillDetector()
        self._motion_start: tuple[float, float] | None = None  # time (s), distance (m); None: none since rest
        self._was_still = self._is_creep_unexplained = False
        self._crept = 0.0  # m, without power, by what offsets do not explain
        self._bias_before_rest = (0.0, 0.0)  # the gyro's bias and its standard deviation, rad/s
        self.contact, self.turn_share = ContactMonitor(robot, readings), TurnShare()
        self.fusion = self._new_fusion(device)

    def configure(self, device: Device) -> None:
        """Start a new filter for the words of this device, with the pose and pose covariance of the old
        one."""
        flat = self.fusion.drive.flat
        self.fusion = self._new_fusion(device)
        self.fusion.drive.copy_pose(flat)
        self._motion_start = None

    def place(self, x: float, y: float, heading: float) -> None:
        """Set the pose (m, m, rad) as known exactly: what a wrong bias turned before no longer counts."""
        self.fusion.place(x, y, heading)
        self._crept = 0.0
        if self._motion_start is not None:
            self._motion_start = self._readings.time, self.fusion.distance

    def _new_fusion(self, device: Device) -> Fusion:
        """A filter without readings, with the scale of this device's words."""
        self._left.lag = self._right.lag = lag_seconds(self._robot, device)
        self._noise = WheelNoise(self._robot, self._settings, device)
        self._creeping = CreepDetector(*known_offset_speeds(self._robot, device))
        self.contact.configure(device)
        per_count = counts_scale(self._robot, "left", device)
        mean, covariance = prior(self._robot, self._settings, device)
        process = process_noise(self._robot, self._settings, per_count)
        return Fusion(DriveFilter(mean, covariance, self._geometry, process), self._settings)

    def advance(self, command: Outputs | None) -> None:
        """Move the filter on by all that was read since it last moved."""
        pending, self._readings.pending = self._readings.pending, Pending()
        span, noise, left, right = pending.span, self._noise, self._left, self._right
        if pending.gap:
            self._bridge(pending)
            return
        values: tuple[float, ...] = (pending.left / span, pending.right / span)
        still, rest_doubt = self._check_standstill(span, command)
        if still:
            self._readings.explain_rest_motion()
        flat = self.fusion.drive.flat
        speeds = values[0] - flat[State.LEFT_OFFSET], values[1] - flat[State.RIGHT_OFFSET]
        self.contact.find_mute_wheels(*speeds, pending.faulty)
        mute = self.contact.mute
        one_mute = mute[0] != mute[1] and pending.gyro_count > 0
        variances = self._wheel_variances(values, span, still, mute if one_mute else (False, False))
        left.step_speed, right.step_speed = values
        left.blind_time = right.blind_time = left.guessed_angle = right.guessed_angle = 0.0
        turn_acceleration = self._turn_acceleration.update(
            span, self._geometry.body_motion(left.speed, right.speed)[1], self._readings.gyro_rate
        )
        shaking = self._shaking.update(span, values[0], values[1])
        differential_variance = noise.runout_variance(values[0], values[1], span) + shaking**2
        turn_timing_std = 0.0
        if pending.gyro_count and pending.gyro_span > 0.5 * span:
            values = (*values, pending.turn / pending.gyro_span)
            turn_timing_std = TURN_TIMING_SHARE * pending.gyro_sharp_turn
            variances = (*variances, self._gyro_variance(pending, shaking))
            if self._gyro.repeats < SUSPICIOUS_REPEATS:
                self._check_signs(span, *values)
        turn = None if len(values) < 3 else (values[2] - flat[State.GYRO_BIAS]) / flat[State.GYRO_SCALE]
        along_variance = self.contact.along_variance(span, *speeds, turn) + self._creep_variance(span)
        if turn is not None:
            unseen_turn_std = self.contact.unseen_turn_std(span, pending.gyro_span / pending.gyro_count)
            turn_timing_std = hypot(turn_timing_std, unseen_turn_std)
        reading = StepReading(
            self._readings.time,
            span,
            values,
            variances,
            turn_acceleration,
            differential_variance,
            still,
            turn_timing_std,
            along_variance,
            self.contact.pushed_across_variance,
            is_wheel_mute=one_mute,
            rest_doubt=rest_doubt,
        )
        self.fusion.advance(reading, self._reasons, self._gyro.repeats >= SUSPICIOUS_REPEATS)
        self.contact.detect_bump(pending, still)

    def _wheel_variances(
        self, speeds: tuple[float, ...], span: float, still: bool, mute: tuple[bool, bool]
    ) -> tuple[float, ...]:
        """(rad/s)^2, variances of the left and right wheel's mean speeds over a step."""
        left = self._noise.variance(self._left, speeds[0], span, still, mute[0])
        return left, self._noise.variance(self._right, speeds[1], span, still, mute[1])

    def _gyro_variance(self, pending: Pending, shaking: float) -> float:
        """(rad/s)^2, variance of the gyro's mean over a step. shaking: rad/s of wheel speed that shakes the
        robot."""
        independent_readings = min(pending.gyro_count, GYRO_RATE_HZ * pending.gyro_span)
        variance = self._settings.gyro_noise**2 / independent_readings + pending.gyro_kink_variance
        return variance + (GYRO_SHAKING_SHARE * self._geometry.body_motion(-shaking, shaking)[1]) ** 2

    def _check_signs(self, span: float, left: float, right: float, gyro: float) -> None:
        """Compare the turn by the wheels' speeds (rad/s) with the gyro's, and report a contradiction."""
        turned = self._geometry.body_motion(left, 0.0)[1], self._geometry.body_motion(0.0, right)[1]
        self._readings.wiring.update(span, *turned, gyro)
        self.turn_share.update(span, sum(turned), gyro)
        if self._readings.wiring.suspects:
            self._reasons.tell(TURN_MISMATCH, self._readings.time)

    def _bridge(self, pending: Pending) -> None:
        """Move the filter over a gap in the readings."""
        span, noise, left, right = pending.span, self._noise, self._left, self._right
        variances = (
            noise.angle_variance(left, pending.left, span),
            noise.angle_variance(right, pending.right, span),
        )
        if (left.silence > HOLD_S) != (right.silence > HOLD_S) and self._gyro.age <= GYRO_TIMEOUT_S:
            variances = self._infer_silent_wheel(pending, variances, left.silence > HOLD_S)
        differential_variance = noise.runout_variance(pending.left, pending.right, 1.0)
        angle_covariance = noise.angle_covariance(left, right)
        end_speeds = left.speed, right.speed
        left.step_speed, right.step_speed = end_speeds
        left.blind_time = right.blind_time = left.guessed_angle = right.guessed_angle = 0.0
        velocity, turn_rate = self._geometry.body_motion(*end_speeds)
        self._turn_acceleration.update(span, turn_rate, self._readings.gyro_rate)
        self._standstill.restart()
        self.contact.restart(velocity, turn_rate)
        reading = StepReading(
            self._readings.time,
            span,
            (pending.left / span, pending.right / span),
            variances,
            0.0,
            differential_variance,
            False,
            end_speeds=end_speeds,
            angle_covariance=angle_covariance,
        )
        self.fusion.advance(reading, self._reasons, False)

    def _infer_silent_wheel(
        self, pending: Pending, variances: tuple[float, float], left_is_silent: bool
    ) -> tuple[float, float]:
        """Set the angle of the silent wheel from the other wheel and the gyro's rate before and after the
        gap. Returns the variances of both angles, rad^2.

        In the gap the robot may not have turned at all, or twice as much, or about the silent wheel.
        """
        flat, span = self.fusion.drive.flat, pending.span
        offset_left, offset_right = span * flat[State.LEFT_OFFSET], span * flat[State.RIGHT_OFFSET]
        before = flat[State.TURN_RATE]
        after = (self._readings.gyro_rate - flat[State.GYRO_BIAS]) / flat[State.GYRO_SCALE]
        # rad by which the wheels differ over the gap for each rad/s of the robot's turn
        angle_per_rate = 2.0 * span / self._geometry.body_motion(-1.0, 1.0)[1]
        difference = 0.5 * (before + after) * angle_per_rate
        doubt = max(abs(before), abs(after)) * angle_per_rate
        if left_is_silent:
            other = pending.right - offset_right
            pending.left = other - difference + offset_left
            return variances[1] + (doubt + abs(other)) ** 2, variances[1]
        other = pending.left - offset_left
        pending.right = other + difference + offset_right
        return variances[0], variances[0] + (doubt + abs(other)) ** 2

    def _check_standstill(self, span: float, command: Outputs | None) -> tuple[bool, RestDoubt | None]:
        """Whether the robot stands, and the uncertainty to add if it seems to creep (else None)."""
        flat = self.fusion.drive.flat
        driven = command is None or any(command.duty[port] != 0.0 for port in self._ports)
        # In the dead zone a wheel reads 0 and may be at rest: the offset of robot.toml is not in that
        # reading.
        left = 0.0 if self._left.blind_time > 0.0 else self._left.settled_speed - flat[State.LEFT_OFFSET]
        right = 0.0 if self._right.blind_time > 0.0 else self._right.settled_speed - flat[State.RIGHT_OFFSET]
        sigma = sqrt(max(flat[_VOL], flat[_VOR]))
        if sigma == 0.0 and (self._left.increment != 0.0 or self._right.increment != 0.0):
            driven = True  # an encoder at rest does not tick
        gyro = None
        if self._gyro.age <= GYRO_TIMEOUT_S:
            gyro = (self._readings.gyro_rate - flat[State.GYRO_BIAS], sqrt(flat[_VB]))
        wheel_excess = max(left, right, -left, -right)
        still = self._standstill.update(span, driven, (wheel_excess, sigma), gyro)
        rate = None if gyro is None else self._readings.gyro_rate
        settled = self._left.settled_speed, self._right.settled_speed
        creeps = self._creeping.update(span, driven, *settled, rate)
        if driven and (self._was_still or self._motion_start is None):
            self._motion_start = self._readings.time, self.fusion.distance
        if not still:
            self._bias_before_rest = flat[State.GYRO_BIAS], sqrt(flat[_VB])
        self._was_still = still
        self._is_creep_unexplained = gyro is not None and not does_offset_explain(wheel_excess, sigma)
        rest_doubt = None
        if creeps and gyro is not None:
            bias_change = abs(self._creeping.mean_rate - self._bias_before_rest[0])
            bias_jumped = bias_change > OTHER_BIAS_MARGIN + 4.0 * self._bias_before_rest[1]
            self._bias_before_rest = self._creeping.mean_rate, gyro[1]
            if bias_jumped or self._is_creep_unexplained:
                start = self._motion_start if bias_jumped else None
                rest_doubt = self._rest_doubt(wheel_excess, sigma, bias_change, start)
            self._motion_start = None
        return still, rest_doubt

    def _creep_variance(self, span: float) -> float:
        """m^2 to add to the position along the heading, of a robot that may stand: all that it has crept."""
        creeping, before, rested = self._creeping, self._crept, self._motion_start is None
        crawls = creeping.is_even or (creeping.may_rest and rested)
        way = span * self.fusion.drive.flat[State.VELOCITY]
        self._crept = before + way if crawls and self._is_creep_unexplained else 0.0
        return max(self._crept**2 - before**2, 0.0)

    def _rest_doubt(
        self, wheel_excess: float, sigma: float, bias_change: float, motion_start: tuple[float, float] | None
    ) -> RestDoubt:
        """Uncertainty of offsets, bias and pose of a robot at rest whose wheels read `wheel_excess` (rad/s)
        beyond their offsets, with standard deviation `sigma`, and whose gyro's bias changed by `bias_change`
        (rad/s).

        The offsets are wrong, and so is the motion that they were taken for. motion_start: s and m, if the
        robot moved since the bias was right. The time of the change is unknown; its mean is halfway between
        then and now, and learning the new bias takes the turn since that time back.
        """
        flat = self.fusion.drive.flat
        hidden_speed = bias_change / self._geometry.body_motion(-1.0, 1.0)[1]  # if the offsets hide a turn
        offsets = max(wheel_excess, hidden_speed) if sigma > 0.0 else 0.0
        is_wheel_explained = does_offset_explain(wheel_excess, sigma)
        heading = REST_TIMING_S * bias_change if is_wheel_explained else CREEP_TIME_S * flat[State.TURN_RATE]
        seconds, place = CREEP_TIME_S, 0.0  # `_creep_variance` has added what the wheels crept
        if motion_start is not None:
            since = self._readings.time - motion_start[0]
            seconds = max(0.5 * since, CREEP_TIME_S)
            heading = max(BIAS_HEADING_SHARE * bias_change * since, abs(heading))
            way = abs(self.fusion.distance - motion_start[1])
            place = BIAS_PLACE_SHARE * bias_change * since * way
        return RestDoubt(offsets, max(bias_change, self._settings.gyro_bias), seconds, heading, place)
