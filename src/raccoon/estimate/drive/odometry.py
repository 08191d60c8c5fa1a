"""Where the robot is, how it moves, and how well both are known: wheels and gyro in one filter.

Once a cycle `Odometry.update` turns raw words into wheel angles and a turn rate, moves the drive filter on
to the newest gyro reading and gives a `DriveEstimate`. The pose is in the field frame, heading unwrapped
(docs/quantities.md); docs/odometry.md derives the filter and shows what it reaches.
"""

from __future__ import annotations

import math
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SIMULATOR, STOP, Device, Inputs, Outputs
from raccoon.estimate.drive.estimate import DriveEstimate, Observation
from raccoon.estimate.drive.fusion import Fusion, Reading
from raccoon.estimate.drive.health import GYRO_TIMEOUT, REPEATED
from raccoon.estimate.drive.noise import WheelNoise
from raccoon.estimate.drive.observations import Seen, Way, heading_seen, line_seen, pose_seen
from raccoon.estimate.drive.prior import prior, process_noise
from raccoon.estimate.drive.published import pose_covariance, published
from raccoon.estimate.drive.readings import DriveReadings, Pending
from raccoon.estimate.drive.standstill import Standstill
from raccoon.estimate.drive.timing import GYRO_SHAKEN, Shaking, Swing
from raccoon.estimate.drive.touch import Touch
from raccoon.estimate.drive.turn_share import TurnShare
from raccoon.estimate.drive.wheels import lag_seconds
from raccoon.estimate.drive.wiring import Wiring
from raccoon.estimate.ekf.filter import DriveFilter, variance_index
from raccoon.estimate.ekf.state import OdometrySettings, State, wheel_scales
from raccoon.model.bemf import counts_scale
from raccoon.model.drive import DriveGeometry

__all__ = ["DriveEstimate", "Observation", "Odometry", "OdometrySettings"]

DEFAULTS = OdometrySettings()
STEP = 0.0175
"""s; the filter moves on with the first gyro reading after it (every 20 ms at 50 and at 200 Hz)."""
DATED = 1.2
"""Of the time between two gyro readings, deviation of when the rate jumped by more than `readings.SHARP`. The
gyro's turn stays what counts: wheels that slip in that moment are worse."""
OTHERWISE = "the robot turns otherwise than its wheels say"
_VB = variance_index(State.GYRO_BIAS)
_VOL, _VOR = variance_index(State.LEFT_OFFSET), variance_index(State.RIGHT_OFFSET)


class Odometry:
    """Estimator of a two-wheel drive. Feed it every cycle.

    Makes its filterpy filter at construction (which imports filterpy: a second or two), never in a cycle.
    Raises ConfigError for settings or a geometry that make no sense.
    """

    def __init__(
        self,
        robot: RobotConfig,
        *,
        x: float = 0.0,
        y: float = 0.0,
        heading: float = 0.0,
        settings: OdometrySettings = DEFAULTS,
    ) -> None:
        self._robot = robot
        self._settings = settings
        self._geometry = DriveGeometry.from_robot(robot)
        self._ports = (robot.drive.left, robot.drive.right)
        self._readings = DriveReadings(robot, settings.imu_latency)
        self._left, self._right = self._readings.left, self._readings.right
        self._gyro, self._reasons = self._readings.gyro, self._readings.reasons
        self._standstill, self._swing, self._shaking = Standstill(), Swing(), Shaking()
        self._touch, self._turn_share = Touch(robot, self._readings), TurnShare()
        self._configure(SIMULATOR)
        self.resets = 0
        """How often the pose was set anew, after which nothing planned in the one before holds."""
        self.reset(x, y, heading)

    @property
    def estimate(self) -> DriveEstimate:
        """The newest estimate."""
        return self._estimate

    @property
    def wheel_scales(self) -> tuple[float, float]:
        """Speed as read over true speed, left and right: 1 where the calibration is right."""
        flat = self._fusion.drive.flat
        return wheel_scales(flat[State.WAY], flat[State.BALANCE])

    @property
    def turn_share(self) -> float:
        """Turn by the gyro over that of the wheels, where all turns say that a number is far off; else 1."""
        return self._turn_share.value

    @property
    def held_way(self) -> float:
        """M that both wheels turned so far while they carry what they do at a wall; 0 where they do not."""
        return self._touch.held_way

    @property
    def slipped(self) -> bool:
        """Whether a wheel slipped since the robot last stood, in a motion that had begun well."""
        return self._fusion.slip.slipped

    @property
    def wiring(self) -> Wiring:
        """Whether the robot turns as its wheels say."""
        return self._readings.wiring

    @property
    def pose_covariance(self) -> NDArray[np.float64]:
        """Covariance of x, y (m) and heading (rad), (3, 3).

        That of the filter's last step (at most 20 ms ago), and what the robot moves in the time by which its
        readings may be early or late.
        """
        return pose_covariance(self._fusion.drive.flat, self._estimate, self._settings.timing)

    def reset(
        self,
        x: float = 0.0,
        y: float = 0.0,
        heading: float = 0.0,
        *,
        position_std: float = 0.0,
        heading_std: float = 0.0,
    ) -> None:
        """Take the robot to be at this pose (m, m, rad); what is known of scales and offsets stays.

        position_std, heading_std: m and rad by which it may have been put down wrong; walls and lines that
        are seen later correct it. Raises ValueError for a value that is not finite or a deviation below 0.
        """
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(heading)):
            raise ValueError(f"pose ({x}, {y}, {heading}): every value must be finite")
        for name, std in (("position_std", position_std), ("heading_std", heading_std)):
            if not 0.0 <= std < math.inf:
                raise ValueError(f"{name} is {std}: allowed are finite numbers from 0")
        self._fusion.place(x, y, heading)
        self._fusion.drive.widen((State.X, State.Y), position_std)
        self._fusion.drive.widen((State.HEADING,), heading_std)
        self._readings.clear()
        self.resets += 1
        self._estimate = self._published()

    def update(self, inputs: Inputs, command: Outputs | None = STOP) -> DriveEstimate:
        """Take the cycle `inputs`, read while `command` was in force, and give the estimate at its time.

        command: None where it is not known: the robot is then never taken to stand because nothing drives it.
        Never raises for what a sensor says; see `DriveEstimate.reasons`.
        """
        if inputs.device is not self._device:
            self._configure(inputs.device)
        self._touch.drive(inputs, command)
        if self._readings.take(inputs) and self._readings.pending.span > STEP:
            self._advance(command)
        self._estimate = self._published()
        return self._estimate

    def observe_pose(
        self,
        x: float,
        y: float,
        heading: float,
        *,
        position_std: float,
        heading_std: float,
        time: float | None = None,
    ) -> Observation:
        """The robot was seen at a pose (m, m, rad), at `time` (None: now).

        A heading counts modulo a turn. Not believed (and not used) where it lies beyond the 99.9 % that the
        present uncertainty allows: after a kidnapping use `reset`. Raises ValueError for values that are not
        finite or a deviation that is not above 0.
        """
        return self._observe(pose_seen(x, y, heading, position_std, heading_std), time)

    def observe_heading(self, heading: float, std: float, *, time: float | None = None) -> Observation:
        """The robot was seen heading this way, rad: aligned to a wall. Otherwise as `observe_pose`."""
        return self._observe(heading_seen(heading, std), time)

    def observe_line(
        self,
        point: tuple[float, float],
        direction: float,
        *,
        sensor: tuple[float, float],
        std: float,
        time: float | None = None,
    ) -> Observation:
        """A sensor crossed the line through `point` (m) along `direction` (rad).

        sensor: m ahead and m to the left of the robot's origin. std: m. Otherwise as `observe_pose`.
        """
        return self._observe(line_seen(point, direction, sensor, std), time)

    def mark(self) -> None:
        """Begin the way that `observe_distance` measures here; `reset` does so too."""
        self._fusion.way = Way()

    def observe_distance(self, distance: float, std: float) -> Observation:
        """The robot went `distance` m (negative: back) since the mark, by tape; it stands now.

        Tells the wheels' scales, and through them corrects the pose. Otherwise as `observe_pose`.
        """
        found = self._fusion.observe_way(distance, std)
        self._estimate = self._published()
        return found

    def _observe(self, seen: Seen, time: float | None) -> Observation:
        if time is not None and not self._readings.time - 10.0 <= time <= self._readings.time:
            return Observation(
                False, math.nan, f"seen at {time} s: allowed are the 2 s before {self._readings.time} s"
            )
        flat = self._fusion.drive.flat
        here = self._estimate
        shift = np.array([here.x - flat[State.X], here.y - flat[State.Y], here.heading - flat[State.HEADING]])
        found = self._fusion.observe(seen, shift, time)
        self._estimate = self._published()
        return found

    def _configure(self, device: Device) -> None:
        """Scale of the words of this device; a new one starts the filter anew, where the old one stood."""
        self._device = device
        self._left.lag = self._right.lag = lag_seconds(self._robot, device)
        self._noise = WheelNoise(self._robot, self._settings, device)
        self._touch.configure(device)
        per_count = counts_scale(self._robot, "left", device)
        mean, covariance = prior(self._robot, self._settings, device)
        drive = DriveFilter(
            mean, covariance, self._geometry, process_noise(self._robot, self._settings, per_count)
        )
        old = getattr(self, "_fusion", None)
        self._fusion = Fusion(drive, self._settings)
        if old is not None:
            x, y, heading = old.drive.flat[: State.VELOCITY]
            self._fusion.place(x, y, heading)

    def _advance(self, command: Outputs | None) -> None:
        """Move the filter to now over the whole time since it last moved."""
        pending, self._readings.pending = self._readings.pending, Pending()
        span, noise, left, right = pending.span, self._noise, self._left, self._right
        if pending.gap:
            self._bridge(pending)
            return
        read: tuple[float, ...] = (pending.left / span, pending.right / span)
        still = self._stands(span, command)
        variances: tuple[float, ...] = (
            noise.variance(left, read[0], span, still),
            noise.variance(right, read[1], span, still),
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
            of_gyro = self._settings.gyro_noise**2 / pending.gyro_count + pending.gyro_kinks
            of_gyro += (GYRO_SHAKEN * self._geometry.body_motion(-shaken, shaken)[1]) ** 2
            variances = (*variances, of_gyro)
            if self._gyro.repeats < REPEATED:
                self._check_signs(span, *read)
        flat = self._fusion.drive.flat
        held = self._touch.carries(
            span, read[0] - flat[State.LEFT_OFFSET], read[1] - flat[State.RIGHT_OFFSET]
        )
        reading = Reading(self._readings.time, span, read, variances, swing, wobble, still, undated, held)
        self._fusion.advance(reading, self._reasons, self._gyro.repeats >= REPEATED)
        self._touch.feel(pending, still)

    def _check_signs(self, span: float, left: float, right: float, gyro: float) -> None:
        """Whether the robot turns as its wheels say, by rad/s of theirs and of the gyro's."""
        turned = self._geometry.body_motion(left, 0.0)[1], self._geometry.body_motion(0.0, right)[1]
        self._readings.wiring.update(span, *turned, gyro)
        self._turn_share.update(span, sum(turned), gyro)
        if self._readings.wiring.suspects:
            self._reasons.tell(OTHERWISE, self._readings.time)

    def _bridge(self, pending: Pending) -> None:
        """Move the filter to now over a time in which nobody looked."""
        span, noise, left, right = pending.span, self._noise, self._left, self._right
        variances = noise.of_angle(left, pending.left, span), noise.of_angle(right, pending.right, span)
        wobble = noise.wobble(pending.left, pending.right, 1.0)
        now = left.speed, right.speed
        left.mean, right.mean = now
        left.blind = right.blind = left.lost = right.lost = 0.0
        velocity, turn_rate = self._geometry.body_motion(*now)
        self._swing.update(span, turn_rate, self._readings.rate)
        self._standstill.interrupt()
        self._touch.interrupt(velocity)
        read = pending.left / span, pending.right / span
        reading = Reading(self._readings.time, span, read, variances, 0.0, wobble, False, now=now)
        self._fusion.advance(reading, self._reasons, False)

    def _stands(self, span: float, command: Outputs | None) -> bool:
        flat = self._fusion.drive.flat
        driven = command is None or any(command.duty[port] != 0.0 for port in self._ports)
        left = self._left.settled - flat[State.LEFT_OFFSET]
        right = self._right.settled - flat[State.RIGHT_OFFSET]
        sigma = sqrt(max(flat[_VOL], flat[_VOR]))
        if sigma == 0.0 and (self._left.increment != 0.0 or self._right.increment != 0.0):
            driven = True  # an encoder at rest does not tick
        gyro = None
        if self._gyro.age <= GYRO_TIMEOUT:
            gyro = (self._readings.rate - flat[State.GYRO_BIAS], sqrt(flat[_VB]))
        return self._standstill.update(span, driven, (max(left, right, -left, -right), sigma), gyro)

    def _published(self) -> DriveEstimate:
        return published(self._fusion, self._readings, self._settings)
