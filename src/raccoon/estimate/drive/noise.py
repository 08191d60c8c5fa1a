"""Variance of a wheel's mean speed over a step of the filter."""

from __future__ import annotations

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device
from raccoon.estimate.drive.wheel_track import HOLD_S, WheelTrack
from raccoon.estimate.drive.wheels import SAMPLE_TIME_S
from raccoon.estimate.ekf.state import OdometrySettings
from raccoon.model.bemf import counts_scale

SILENT_WHEEL = 50.0
"""(rad/s)^2 over one second, variance of a wheel without a reading: it may turn at any speed."""
UNCOUNTED_CORRELATION = 0.9
"""Correlation of the angles of both wheels that were not counted: a controller that hung or restarted let
both turn on, or stopped both."""


class WheelNoise:
    """Variances of wheel readings of a robot with a device, (rad/s)^2."""

    def __init__(self, robot: RobotConfig, settings: OdometrySettings, device: Device) -> None:
        per_count = counts_scale(robot, "left", device)
        self._settings = settings
        self._radius = robot.model.drive.wheel_radius.value
        self._tick = per_count * device.position_counts_seconds
        self._bemf_density = (settings.bemf_noise_counts * per_count) ** 2 * SAMPLE_TIME_S
        self._dead_zone_variance = (
            device.bemf_dead_zone * per_count
        ) ** 2 / 3.0  # anywhere within the dead zone

    def variance(
        self, wheel: WheelTrack, speed: float, span: float, still: bool = False, is_mute: bool = False
    ) -> float:
        """(rad/s)^2, of a wheel's mean speed over `span` s. still: the robot stands. is_mute: its reading is
        not used.

        It sums noise or tick steps, a little slip at all times, the timing uncertainty, and the dead zone. A
        wheel at rest within the dead zone gives no information: however often it reads 0, its offset may be
        as large as the zone.
        """
        if is_mute or wheel.silence > HOLD_S or (still and wheel.blind_time > 0.0):
            return SILENT_WHEEL / span
        tick_variance = (self._tick / span) ** 2 / 6.0
        noise = self._bemf_density / span if wheel.has_bemf else tick_variance
        slip = self._settings.slip_noise**2 * abs(speed) / (self._radius * span)
        late_std = self._settings.timing * (speed - wheel.step_speed) / span
        unseen_variance = (
            self._dead_zone_variance * min(wheel.blind_time / span, 1.0) + (wheel.guessed_angle / span) ** 2
        )
        return noise + slip + late_std * late_std + unseen_variance + 1e-10

    def angle_variance(self, wheel: WheelTrack, angle: float, span: float) -> float:
        """rad^2, of the angle (rad) that a wheel turned over a gap of `span` s, by its counter."""
        if wheel.silence > HOLD_S:
            return SILENT_WHEEL * span
        tick_variance = self._tick**2 / 3.0
        lag_variance = self._bemf_density / SAMPLE_TIME_S * wheel.lag**2
        slip = self._settings.slip_noise**2 * abs(angle) / self._radius
        late_std = self._settings.timing * (wheel.speed - wheel.step_speed)
        return tick_variance + lag_variance + slip + late_std * late_std + wheel.guessed_angle**2 + 1e-10

    def angle_covariance(self, left: WheelTrack, right: WheelTrack) -> float:
        """Covariance of the angles that both wheels turned over a gap, rad^2."""
        return UNCOUNTED_CORRELATION * left.guessed_angle * right.guessed_angle

    def runout_variance(self, left: float, right: float, span: float) -> float:
        """(rad/s)^2, of half the difference of both wheels' mean speeds, because they are not round.

        A runout repeats with every revolution, so its error of the distance does not grow. But a turn takes
        about one revolution, and what it shows of the scales is wrong by the runout's mean over that arc.
        White noise of 0.7 runout^2 a rad is as uncertain as that mean for arcs of a quarter to a whole
        revolution.
        """
        return 0.25 * 0.7 * self._settings.runout**2 * (abs(left) + abs(right)) / span
