"""How far a wheel's mean speed over a step of the filter may be off."""

from __future__ import annotations

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device
from raccoon.estimate.drive.wheel_track import HOLD, WheelTrack
from raccoon.estimate.drive.wheels import SAMPLE_TIME
from raccoon.estimate.ekf.state import OdometrySettings
from raccoon.model.bemf import counts_scale

SILENT_WHEEL = 50.0
"""(rad/s)^2 over one second, variance of a wheel that gives no reading: it may turn at any speed."""
TOGETHER = 0.9
"""Correlation of what both wheels turned uncounted: a controller that hung or restarted let both go on, or
stopped both."""


class WheelNoise:
    """Variances of wheel readings of a robot on a device, (rad/s)^2."""

    def __init__(self, robot: RobotConfig, settings: OdometrySettings, device: Device) -> None:
        per_count = counts_scale(robot, "left", device)
        self._settings = settings
        self._radius = robot.model.drive.wheel_radius.value
        self._tick = per_count * device.position_counts_seconds
        self._bemf = (settings.bemf_noise_counts * per_count) ** 2 * SAMPLE_TIME
        self._dead_zone = (device.bemf_dead_zone * per_count) ** 2 / 3.0  # anywhere within the dead zone

    def variance(
        self, wheel: WheelTrack, speed: float, span: float, still: bool = False, mute: bool = False
    ) -> float:
        """Of a wheel's mean speed over `span`. still: the robot stands. mute: what it reads is no reading.

        Noise or tick steps, a little slip everywhere, being a little early or late, and what a dead zone
        hides. A wheel that stands within it says nothing: however often it reads 0, its offset may be as
        large as the zone.
        """
        if mute or wheel.silent > HOLD or (still and wheel.blind > 0.0):
            return SILENT_WHEEL / span
        steps = (self._tick / span) ** 2 / 6.0
        noise = self._bemf / span if wheel.fine else steps
        slip = self._settings.slip_noise**2 * abs(speed) / (self._radius * span)
        late = self._settings.timing * (speed - wheel.mean) / span
        unseen = self._dead_zone * min(wheel.blind / span, 1.0) + (wheel.lost / span) ** 2
        return noise + slip + late * late + unseen + 1e-10

    def of_angle(self, wheel: WheelTrack, angle: float, span: float) -> float:
        """Of the angle (rad) that a wheel turned over a gap of `span` s by its counter, rad^2."""
        if wheel.silent > HOLD:
            return SILENT_WHEEL * span
        steps = self._tick**2 / 3.0
        ahead = self._bemf / SAMPLE_TIME * wheel.lag**2
        slip = self._settings.slip_noise**2 * abs(angle) / self._radius
        late = self._settings.timing * (wheel.speed - wheel.mean)
        return steps + ahead + slip + late * late + wheel.lost**2 + 1e-10

    def together(self, left: WheelTrack, right: WheelTrack) -> float:
        """Covariance of the angles that both wheels turned over a gap, rad^2."""
        return TOGETHER * left.lost * right.lost

    def wobble(self, left: float, right: float, span: float) -> float:
        """Of half the difference of both wheels' mean speeds, because they are not round.

        A runout repeats with every revolution, so it loses no way in the long run; but a turn takes about
        one, and what it tells of the scales is wrong by the runout's mean over that arc. White noise of
        0.7 runout^2 a rad is as uncertain as that mean for arcs of a quarter to a whole revolution.
        """
        return 0.25 * 0.7 * self._settings.runout**2 * (abs(left) + abs(right)) / span
