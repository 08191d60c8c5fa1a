"""Steps of the drive filter: what was read since the last one, over the whole time in between."""

from __future__ import annotations

from math import hypot, sqrt

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device, Outputs
from raccoon.estimate.drive.fusion import Fusion
from raccoon.estimate.drive.health import GYRO_TIMEOUT, REPEATED
from raccoon.estimate.drive.noise import WheelNoise
from raccoon.estimate.drive.prior import prior, process_noise
from raccoon.estimate.drive.readings import DriveReadings, Pending
from raccoon.estimate.drive.standstill import CREEP_TIME, OTHER_BIAS, Creeping, Standstill, offset_explains
from raccoon.estimate.drive.taken import Reading, RestDoubt
from raccoon.estimate.drive.timing import GYRO_SHAKEN, Shaking, Swing
from raccoon.estimate.drive.touch import Touch
from raccoon.estimate.drive.turn_share import TurnShare
from raccoon.estimate.drive.wheel_track import HOLD
from raccoon.estimate.drive.wheels import lag_seconds
from raccoon.estimate.ekf.filter import DriveFilter, variance_index
from raccoon.estimate.ekf.state import OdometrySettings, State
from raccoon.model.bemf import counts_scale
from raccoon.model.drive import DriveGeometry

DATED = 1.2
"""Of the time between two gyro readings, deviation of when the rate jumped by more than `readings.SHARP`. The
gyro's turn stays what counts: wheels that slip in that moment are worse."""
GYRO_RATE = 100.0
"""Hz, readings of a gyro with a noise of their own: its chip smooths with 41 Hz, so that those which come
more often share it."""
DATED_REST = 0.05
"""s by which it is in doubt since when a robot has stood that seems to creep."""
EVENLY, ASTRAY = 0.29, 0.25
"""Of what a bias has turned that may have come at any time since, deviation of the heading; and of that times
the way, deviation of the place: across the way, by half of it, and half of that by when it came."""
OTHERWISE = "the robot turns otherwise than its wheels say"
_VB = variance_index(State.GYRO_BIAS)
_VOL, _VOR = variance_index(State.LEFT_OFFSET), variance_index(State.RIGHT_OFFSET)


class Steps:
    """Moves the filter on, and feeds with each step what watches the drive.

    fusion: the filter at work, another one for each device. touch, turn_share: of what was read so far.
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
        self._standstill, self._swing, self._shaking = Standstill(), Swing(), Shaking()
        self._creeping = Creeping()
        self._begun_at: tuple[float, float] | None = None  # s and m, where it has moved since it last stood
        self._stood, self._bias = False, (0.0, 0.0)  # rad/s of the gyro and how sure, before it stood
        self.touch, self.turn_share = Touch(robot, readings), TurnShare()
        self.fusion = self._begun(device)

    def configure(self, device: Device) -> None:
        """Words of this device follow: the filter starts anew where the old one stood, as sure of that."""
        flat = self.fusion.drive.flat
        self.fusion = self._begun(device)
        self.fusion.drive.take_pose(flat)
        self._begun_at = None

    def place(self, x: float, y: float, heading: float) -> None:
        """Take the pose to be known: what a bias turned before no longer counts."""
        self.fusion.place(x, y, heading)
        if self._begun_at is not None:
            self._begun_at = self._readings.time, self.fusion.distance

    def _begun(self, device: Device) -> Fusion:
        """A filter that has read nothing, and the scale of this device's words."""
        self._left.lag = self._right.lag = lag_seconds(self._robot, device)
        self._noise = WheelNoise(self._robot, self._settings, device)
        self.touch.configure(device)
        per_count = counts_scale(self._robot, "left", device)
        mean, covariance = prior(self._robot, self._settings, device)
        drive = DriveFilter(
            mean, covariance, self._geometry, process_noise(self._robot, self._settings, per_count)
        )
        return Fusion(drive, self._settings)

    def advance(self, command: Outputs | None) -> None:
        """Move the filter to now over the whole time since it last moved."""
        pending, self._readings.pending = self._readings.pending, Pending()
        span, noise, left, right = pending.span, self._noise, self._left, self._right
        if pending.gap:
            self._bridge(pending)
            return
        read: tuple[float, ...] = (pending.left / span, pending.right / span)
        still, rest = self._stands(span, command)
        if still:
            self._readings.rest()
        flat = self.fusion.drive.flat
        speeds = read[0] - flat[State.LEFT_OFFSET], read[1] - flat[State.RIGHT_OFFSET]
        self.touch.listen(*speeds, pending.faulty)
        mute = self.touch.mute
        alone = mute[0] != mute[1] and pending.gyro_count > 0
        variances: tuple[float, ...] = (
            noise.variance(left, read[0], span, still, alone and mute[0]),
            noise.variance(right, read[1], span, still, alone and mute[1]),
        )
        left.mean, right.mean = read
        left.blind = right.blind = left.lost = right.lost = 0.0
        swing = self._swing.update(
            span, self._geometry.body_motion(left.speed, right.speed)[1], self._readings.rate
        )
        shaken = self._shaking.update(span, read[0], read[1])
        wobble = noise.wobble(read[0], read[1], span) + shaken**2
        undated = 0.0
        if pending.gyro_count and pending.gyro_span > 0.5 * span:
            read = (*read, pending.turn / pending.gyro_span)
            undated = DATED * pending.gyro_sharp
            apart = min(pending.gyro_count, GYRO_RATE * pending.gyro_span)
            of_gyro = self._settings.gyro_noise**2 / apart + pending.gyro_kinks
            of_gyro += (GYRO_SHAKEN * self._geometry.body_motion(-shaken, shaken)[1]) ** 2
            variances = (*variances, of_gyro)
            if self._gyro.repeats < REPEATED:
                self._check_signs(span, *read)
        turn = None if len(read) < 3 else (read[2] - flat[State.GYRO_BIAS]) / flat[State.GYRO_SCALE]
        held = self.touch.carries(span, *speeds) + self.touch.rolls(span, *speeds, turn) + self.touch.pushed
        if turn is not None:
            undated = hypot(undated, self.touch.turned_unseen(span, pending.gyro_span / pending.gyro_count))
        time = self._readings.time - self._readings.ahead[0]
        aside = self.touch.pushed_aside
        reading = Reading(
            time, span, read, variances, swing, wobble, still, undated, held, aside, mute=alone, rest=rest
        )
        self.fusion.advance(reading, self._reasons, self._gyro.repeats >= REPEATED)
        self.touch.feel(pending, still)

    def _check_signs(self, span: float, left: float, right: float, gyro: float) -> None:
        """Whether the robot turns as its wheels say, by rad/s of theirs and of the gyro's."""
        turned = self._geometry.body_motion(left, 0.0)[1], self._geometry.body_motion(0.0, right)[1]
        self._readings.wiring.update(span, *turned, gyro)
        self.turn_share.update(span, sum(turned), gyro)
        if self._readings.wiring.suspects:
            self._reasons.tell(OTHERWISE, self._readings.time)

    def _bridge(self, pending: Pending) -> None:
        """Move the filter to now over a time in which nobody looked."""
        span, noise, left, right = pending.span, self._noise, self._left, self._right
        variances = noise.of_angle(left, pending.left, span), noise.of_angle(right, pending.right, span)
        if (left.silent > HOLD) != (right.silent > HOLD) and self._gyro.age <= GYRO_TIMEOUT:
            variances = self._with_other(pending, variances, left.silent > HOLD)
        wobble, together = noise.wobble(pending.left, pending.right, 1.0), noise.together(left, right)
        now = left.speed, right.speed
        left.mean, right.mean = now
        left.blind = right.blind = left.lost = right.lost = 0.0
        velocity, turn_rate = self._geometry.body_motion(*now)
        self._swing.update(span, turn_rate, self._readings.rate)
        self._standstill.interrupt()
        self.touch.interrupt(velocity, turn_rate)
        read = pending.left / span, pending.right / span
        time = self._readings.time - self._readings.ahead[0]
        reading = Reading(time, span, read, variances, 0.0, wobble, False, now=now, together=together)
        self.fusion.advance(reading, self._reasons, False)

    def _with_other(
        self, pending: Pending, variances: tuple[float, float], left: bool
    ) -> tuple[float, float]:
        """Let the wheel that is silent (left or right) have turned as the other one and the gyro's rate
        before and after that time say; variances of both angles, rad^2.

        In between the robot may not have turned at all, or twice as much, and about the silent wheel.
        """
        flat, span = self.fusion.drive.flat, pending.span
        offset_left, offset_right = span * flat[State.LEFT_OFFSET], span * flat[State.RIGHT_OFFSET]
        before = flat[State.TURN_RATE]
        after = (self._readings.rate - flat[State.GYRO_BIAS]) / flat[State.GYRO_SCALE]
        a_turn = 2.0 * span / self._geometry.body_motion(-1.0, 1.0)[1]  # rad of the wheels for each rad/s
        apart, doubt = 0.5 * (before + after) * a_turn, max(abs(before), abs(after)) * a_turn
        if left:
            other = pending.right - offset_right
            pending.left = other - apart + offset_left
            return variances[1] + (doubt + abs(other)) ** 2, variances[1]
        other = pending.left - offset_left
        pending.right = other + apart + offset_right
        return variances[0], variances[0] + (doubt + abs(other)) ** 2

    def _stands(self, span: float, command: Outputs | None) -> tuple[bool, RestDoubt | None]:
        """Whether it does, and what is in doubt where it seems to creep."""
        flat = self.fusion.drive.flat
        driven = command is None or any(command.duty[port] != 0.0 for port in self._ports)
        # Who reads nothing within the dead zone may be at rest: there an offset of robot.toml does not show.
        left = 0.0 if self._left.blind > 0.0 else self._left.settled - flat[State.LEFT_OFFSET]
        right = 0.0 if self._right.blind > 0.0 else self._right.settled - flat[State.RIGHT_OFFSET]
        sigma = sqrt(max(flat[_VOL], flat[_VOR]))
        if sigma == 0.0 and (self._left.increment != 0.0 or self._right.increment != 0.0):
            driven = True  # an encoder at rest does not tick
        gyro = None
        if self._gyro.age <= GYRO_TIMEOUT:
            gyro = (self._readings.rate - flat[State.GYRO_BIAS], sqrt(flat[_VB]))
        off = max(left, right, -left, -right)
        still = self._standstill.update(span, driven, (off, sigma), gyro)
        rate = None if gyro is None else self._readings.rate
        creeps = self._creeping.update(span, driven, self._left.settled, self._right.settled, rate)
        if driven and (self._stood or self._begun_at is None):
            self._begun_at = self._readings.time, self.fusion.distance
        if not still:
            self._bias = flat[State.GYRO_BIAS], sqrt(flat[_VB])
        self._stood = still
        rest = None
        if creeps and gyro is not None:
            other = abs(self._creeping.mean - self._bias[0])
            jumped = other > OTHER_BIAS + 4.0 * self._bias[1]
            self._bias = self._creeping.mean, gyro[1]
            if jumped or not offset_explains(off, sigma):
                rest = self._rest_doubt(off, sigma, other, self._begun_at if jumped else None)
            self._begun_at = None
        return still, rest

    def _rest_doubt(
        self, wheel: float, sigma: float, gyro: float, begun: tuple[float, float] | None
    ) -> RestDoubt:
        """The robot stands, and its wheels and gyro read so much, rad/s, beyond their offsets, known to
        `sigma`: what is known of these is wrong, and so was the motion that it has been taken for.

        begun: s and m, where it has moved since the bias was right. It became another one nobody knows when,
        on average halfway between then and now, which is taken back as the new one is learnt.
        """
        flat = self.fusion.drive.flat
        turned = gyro / self._geometry.body_motion(-1.0, 1.0)[1]  # by wheels whose offsets hide it
        offsets = max(wheel, turned) if sigma > 0.0 else 0.0
        phantom = DATED_REST * gyro if offset_explains(wheel, sigma) else CREEP_TIME * flat[State.TURN_RATE]
        seconds, way = CREEP_TIME, CREEP_TIME * flat[State.VELOCITY]
        if begun is not None:
            since = self._readings.time - begun[0]
            seconds, phantom = max(0.5 * since, CREEP_TIME), max(EVENLY * gyro * since, phantom)
            way = max(ASTRAY * gyro * since * abs(self.fusion.distance - begun[1]), abs(way))
        return RestDoubt(offsets, max(gyro, self._settings.gyro_bias), seconds, phantom, way)
