"""Limits of the wheels' speeds: what the weakest battery gives, what the controller can read, and for unread
wheels the last command."""

from __future__ import annotations

import math
from collections.abc import Callable

from raccoon.control.feedforward import WheelModel
from raccoon.control.voltage import SpeedBudget
from raccoon.control.wheels import WheelTarget
from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device
from raccoon.core.sections import MotionConfig
from raccoon.model.bemf import counts_scale

# A wheel is never planned slower than this share of its speed without load, however little is said to be left
# for it by the battery and the wished acceleration.
MIN_SPEED_SHARE = 0.3
READ_SHARE = 0.95
"""Share of the readable back-EMF up to which controlled wheels are driven: noise and overshoot stay within
the rest."""
COUNT_SHARE = 1.5
"""Lowest speed of a motor that must be counted, in units of the controller's dead zone: it does not turn
evenly."""
DEFAULT_MOTION = MotionConfig()
"""Default accelerations."""


class SpeedLimits:
    """The speeds with which motions are planned, the same for the whole match, so that a run is the same on a
    fresh battery.

    models: the wheels'. They and `max_readable_speed` depend on the controller, see `configure`.
    """

    def __init__(self, config: RobotConfig, models: tuple[WheelModel, WheelModel]) -> None:
        drive, battery = config.model.drive, config.model.battery
        self._config = config
        self._models = models
        self._budget = SpeedBudget(config.battery.weakest, battery.internal_resistance.value)
        self._radius = drive.wheel_radius.value
        self._half_track = 0.5 * drive.track_width.value
        self._turn_inertia_share = drive.inertia_turn.value / drive.inertia_straight.value
        self._device = ""
        self.max_readable_speed = math.inf
        """rad/s of a wheel up to which its back-EMF is surely readable."""
        self.was_limited = False
        """Whether a program requested more than that."""
        self._was_remarked = False
        self._min_countable_speed = 0.0  # rad/s of a wheel from which on all of its way is counted
        self._was_raised = (
            False  # whether a program wished for less than that, and nobody has asked for the remark
        )

    def configure(self, device: Device, models: tuple[WheelModel, WheelModel]) -> None:
        """Take over what this device can read, and the wheels' models by the meaning of its words."""
        self._device, self._models = device.name, models
        self.max_readable_speed, self.was_limited, self._was_remarked = math.inf, False, False
        if device.bemf_range is not None:
            slower = min(counts_scale(self._config, side, device) for side in ("left", "right"))
            self.max_readable_speed = READ_SHARE * device.bemf_range * slower
        self._min_countable_speed = max(
            min_counted_rate(device, counts_scale(self._config, side, device)) for side in ("left", "right")
        )

    def readable_share(self, left: float, right: float) -> float:
        """Common factor for both wheel speeds (rad/s) with which they are readable."""
        fastest = max(abs(left), abs(right))
        return self.max_readable_speed / fastest if fastest > self.max_readable_speed else 1.0

    @property
    def has_remark(self) -> bool:
        """Whether a request was limited and the remark about it was not fetched yet."""
        return self._was_raised or (self.was_limited and not self._was_remarked)

    def remark(self) -> str:
        """The reason for the limit, in words."""
        if self._was_raised:
            self._was_raised = False
            return (
                f"wheels are driven at {self._min_countable_speed * self._radius:.3f} m/s at least: "
                f"{self._device} cannot count slower wheels, so the position of the robot would be unknown"
            )
        self._was_remarked = True
        return (
            f"wheels are driven at {self.max_readable_speed * self._radius:.3f} m/s at most: {self._device} "
            "cannot read the back-EMF of faster wheels, so the position of the robot would be unknown"
        )

    def planned_speed(self, wanted: float, acceleration: float, outer: float = 1.0) -> float:
        """The highest speed (m/s) up to `wanted` that the weakest battery of the match can give and that is
        readable. acceleration: m/s2 while it speeds up. outer: speed of the faster wheel over the robot's."""
        gain = acceleration * outer / self._radius
        top = min(
            max(
                MIN_SPEED_SHARE * self._budget.weakest / wheel.back_emf_constant,
                self._budget.top_wheel_speed(wheel, gain),
            )
            for wheel in self._models
        )
        # What keeps a robot on its path comes on top, and must be read too.
        most = (1.0 - self._budget.reserve) * self.max_readable_speed
        if min(wanted * outer / self._radius, top) > most:
            self.was_limited = True
            top = most
        return min(wanted, top * self._radius / outer)

    def planned(
        self, wanted: float, acceleration: float, outer: float = 1.0, *, counted: bool = True
    ) -> tuple[float, float]:
        """Speed (m/s, see `planned_speed`) and acceleration (m/s2) to plan with, at most these.

        counted: a speed so low that the controller would miss a part of the way is raised to one at which it
        counts all of it; otherwise the robot would drive too far. Acceleration takes voltage that the speed
        then lacks. So of an acceleration above the default only as much is planned as leaves the default's
        speed: a higher acceleration never makes a robot slower. The default is that of the faster wheel: in a
        sharp bend the robot itself accelerates less.
        """
        least = self._min_countable_speed * self._radius / outer
        if counted and 0.0 < wanted < least:
            wanted, self._was_raised = least, True
        usual = DEFAULT_MOTION.acceleration / outer
        return _limit_acceleration(lambda gain: self.planned_speed(wanted, gain, outer), acceleration, usual)

    def planned_turn(self, wanted: float, acceleration: float) -> tuple[float, float]:
        """`planned` for a turn on the spot: rad/s and rad/s2."""
        return _limit_acceleration(
            lambda gain: self.planned_turn_rate(wanted, gain), acceleration, DEFAULT_MOTION.turn_acceleration
        )

    def planned_turn_rate(self, wanted: float, acceleration: float) -> float:
        """The highest turn rate on the spot (rad/s) up to `wanted`, limited like `planned_speed`."""
        share = self._half_track * self._turn_inertia_share
        speed = self.planned_speed(wanted * self._half_track, acceleration * share)
        return speed / self._half_track


class UnreadWheels:
    """Limits wheels that are not read to what they were commanded when last read: a motion believes that the
    robot stands, and would try to catch up."""

    def __init__(self) -> None:
        self._asked_when_read = (0.0, 0.0)  # rad/s of each wheel, without its sign

    def limit_target(self, target: WheelTarget, silent: tuple[bool, bool]) -> WheelTarget:
        """The target, reduced by one factor for both wheels if a silent one is commanded more than when last
        read."""
        asked, share = (abs(target.left), abs(target.right)), 1.0
        for unread, speed, before in zip(silent, asked, self._asked_when_read, strict=True):
            if unread and speed > before:
                share = min(share, before / speed)
        left_before, right_before = self._asked_when_read
        self._asked_when_read = (
            left_before if silent[0] else asked[0],
            right_before if silent[1] else asked[1],
        )
        if share == 1.0:
            return target
        return WheelTarget(
            share * target.left,
            share * target.right,
            share * target.left_acceleration,
            share * target.right_acceleration,
        )


def min_counted_rate(device: Device, radians_per_count: float) -> float:
    """rad/s from which a motor's way is counted completely. radians_per_count: rad/s per count of
    back-EMF."""
    return COUNT_SHARE * device.bemf_dead_zone * radians_per_count


def _limit_acceleration(
    speed_at: Callable[[float], float], wished: float, usual: float
) -> tuple[float, float]:
    """The speed, and the highest acceleration up to `wished`, that leave the usual acceleration's speed."""
    if wished <= usual or speed_at(wished) >= speed_at(usual):
        return speed_at(wished), wished
    low, high, speed = usual, wished, speed_at(usual)
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if speed_at(middle) >= speed else (low, middle)
    return speed, low
