"""Timing of wheels and gyro: the change of the turn rate, which shows the delay between them; turns too quick
for both; and which of the two is late."""

from __future__ import annotations

from math import exp, sqrt

from raccoon.estimate.ekf.filter import variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State

MIN_TURN_ACCELERATION = 1.0
"""rad/s2; a slower change may be noise."""
SAME_TURN_SHARE = 0.6
"""Largest difference of the turn rates of wheels and gyro, as a share of the faster one, that still counts as
the same turn."""

SHAKING_MEMORY_S = 0.15
"""s, time constant of the memory of shaking."""
GYRO_SHAKING_SHARE = 0.02
"""Error of the gyro's mean over a step as a share of the shaking: readings are a few ms away from their
time."""
MIN_SHAKING = 0.5
"""rad/s of half the wheels' speed difference, to and fro, below which it is not shaking; turns of the motions
stay below, except those that end as soon as they have begun."""
MIN_REVERSAL = 0.2
"""rad/s of change in the opposite direction, above noise, that counts as a reversal."""

_DELAY = variance_index(State.GYRO_DELAY)


class TurnAcceleration:
    """Change of the turn rate. Call `update` at the end of every step of the filter."""

    __slots__ = ("_before",)

    def __init__(self) -> None:
        self._before = 0.0, 0.0

    def update(self, span: float, wheels: float, gyro: float) -> float:
        """The change of the wheels' turn rate, rad/s2, from the turn rates by wheels and gyro (rad/s),
        `span` s after the last ones.

        0 if it may be noise, or if the gyro shows another turn: that is slip, and no sign of a delay.
        """
        before, self._before = self._before, (wheels, gyro)
        swing, fastest = (wheels - before[0]) / span, max(map(abs, (*before, wheels, gyro)))
        return (
            swing
            if abs(swing) > MIN_TURN_ACCELERATION and abs(wheels - gyro) < SAME_TURN_SHARE * fastest
            else 0.0
        )


class Shaking:
    """How much the wheels shake the robot to and fro, as full power on one and then the other wheel does
    every 20 to 60 ms. Call `update` in every step of the filter.

    Gyro and wheels smooth and sample such turns differently, so one of them reads less, step after step: to
    the filter that looks like a scale and not like noise. A turn that ends as soon as it has begun goes up
    and down, too, but only once. Its end is as informative as its beginning, and without its end the delay
    between wheels and gyro would look like a scale.
    """

    __slots__ = (
        "_direction",
        "_fall",
        "_half_difference",
        "_last_extreme",
        "_quiet_seconds",
        "_reversals",
        "_rise",
    )

    def __init__(self) -> None:
        self._half_difference = self._rise = self._fall = 0.0
        self._last_extreme = self._direction = self._quiet_seconds = 0.0
        self._reversals = 0

    def update(self, span: float, left: float, right: float) -> float:
        """rad/s by which half the difference of the wheels' speeds (rad/s) has recently gone both up and
        down, beyond what a turn does that begins and ends; 0 if it did so only once."""
        half, keep = 0.5 * (right - left), exp(-span / SHAKING_MEMORY_S)
        change, self._half_difference = half - self._half_difference, half
        self._rise = self._rise * keep + max(change, 0.0)
        self._fall = self._fall * keep + max(-change, 0.0)
        self._count_reversals(span, half)
        return max(0.0, min(self._rise, self._fall) - MIN_SHAKING) if self._reversals > 1 else 0.0

    def _count_reversals(self, span: float, half: float) -> None:
        """Count the reversals since the last steady phase."""
        gone = half - self._last_extreme
        self._quiet_seconds += span
        if gone * self._direction > 0.0 or abs(gone) > MIN_REVERSAL:
            self._reversals += gone * self._direction < 0.0
            self._last_extreme, self._direction, self._quiet_seconds = half, gone, 0.0
        elif self._quiet_seconds > SHAKING_MEMORY_S:
            self._last_extreme, self._direction, self._reversals = half, 0.0, 0


def wheels_lead(flat: Flat, timing: float) -> tuple[float, float]:
    """s by which the wheels are ahead of the robot, and its standard deviation.

    Only the delay between wheels and gyro is observable. A gyro cannot be early: if the wheels are behind it,
    they are late. If the gyro is behind the wheels, it may be late, or the wheels may slip while they
    accelerate: half of the delay is attributed to each, and either may be all of it. timing: s, remaining
    standard deviation.
    """
    delay, variance = flat[State.GYRO_DELAY], flat[_DELAY]
    if delay <= 0.0:
        return delay, sqrt(timing**2 + variance)
    half = 0.5 * delay
    return half, sqrt(timing**2 + half * half + 0.25 * variance)


def delay_motion(flat: Flat, lead: float, velocity: float, turn_rate: float) -> tuple[float, float]:
    """m and rad from the pose of a filter state to the robot; the state's heading is of the gyro's time, its
    position of the wheels'. lead: s, of `wheels_lead`. velocity, turn_rate: m/s and rad/s."""
    return -lead * velocity, (flat[State.GYRO_DELAY] - lead) * turn_rate


def believed_delay_motion(flat: Flat, timing: float) -> tuple[float, float]:
    """`delay_motion` at the state's own speeds. timing: see `wheels_lead`."""
    lead, _ = wheels_lead(flat, timing)
    return delay_motion(flat, lead, flat[State.WAY] * flat[State.VELOCITY], flat[State.TURN_RATE])
