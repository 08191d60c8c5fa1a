"""Wheels and gyro in time: how fast the turn rate changes, which shows the delay between them; turns that are
too quick for both; and which of both is late.
"""

from __future__ import annotations

from math import exp, sqrt

from raccoon.estimate.ekf.filter import variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State

MIN_TURN_ACCELERATION = 1.0
"""rad/s2; less may be noise."""
SAME_TURN_SHARE = 0.6
"""Share of the faster of both turn rates by which wheels and gyro may differ and still mean one turn."""

SHAKING_MEMORY_S = 0.15
"""s for which it counts that the wheels shook the robot."""
GYRO_SHAKING_SHARE = 0.02
"""Share of it by which the gyro's mean over a step may be off: readings lie a few ms beside their time."""
MIN_SHAKING = 0.5
"""rad/s of half the wheels' difference, to and fro; in turns of the motions, but of those that
end as soon as they have begun, it is less."""
MIN_REVERSAL = 0.2
"""rad/s of it the other way, beyond noise, that count as one."""

_DELAY = variance_index(State.GYRO_DELAY)


class TurnAcceleration:
    """How fast the turn rate changes. Feed it at the end of every step of the filter."""

    __slots__ = ("_before",)

    def __init__(self) -> None:
        self._before = 0.0, 0.0

    def update(self, span: float, wheels: float, gyro: float) -> float:
        """The change of the wheels' turn rate, rad/s2, from the turn rates by wheels and by gyro, `span` s
        after the last ones.

        0 where that may be noise, and where the gyro sees another turn: then it is slip, and nobody is late.
        """
        before, self._before = self._before, (wheels, gyro)
        swing, fastest = (wheels - before[0]) / span, max(map(abs, (*before, wheels, gyro)))
        return (
            swing
            if abs(swing) > MIN_TURN_ACCELERATION and abs(wheels - gyro) < SAME_TURN_SHARE * fastest
            else 0.0
        )


class Shaking:
    """How much the wheels shake the robot to and fro, as full power on one and then on the other does every
    20 to 60 ms. Feed it every step of the filter.

    Gyro and wheels smooth and sample such a turn in their own ways. The one then reads a share less of it
    than the other, step after step: to the filter that looks like a scale, and not like noise. A turn that
    ends as soon as it has begun goes up and down as well, but once: what its end tells is as good as what its
    beginning told, and without it the delay between wheels and gyro would be taken for a scale.
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
        """How much half the difference of the wheels' speeds (rad/s) has lately gone both up and down, beyond
        what a turn does that begins and ends; 0 where it did so once.
        """
        half, keep = 0.5 * (right - left), exp(-span / SHAKING_MEMORY_S)
        change, self._half_difference = half - self._half_difference, half
        self._rise = self._rise * keep + max(change, 0.0)
        self._fall = self._fall * keep + max(-change, 0.0)
        self._count_reversals(span, half)
        return max(0.0, min(self._rise, self._fall) - MIN_SHAKING) if self._reversals > 1 else 0.0

    def _count_reversals(self, span: float, half: float) -> None:
        """Count how often it went the other way since it was last steady."""
        gone = half - self._last_extreme
        self._quiet_seconds += span
        if gone * self._direction > 0.0 or abs(gone) > MIN_REVERSAL:
            self._reversals += gone * self._direction < 0.0
            self._last_extreme, self._direction, self._quiet_seconds = half, gone, 0.0
        elif self._quiet_seconds > SHAKING_MEMORY_S:
            self._last_extreme, self._direction, self._reversals = half, 0.0, 0


def wheels_lead(flat: Flat, timing: float) -> tuple[float, float]:
    """s by which the wheels are ahead of the robot, and the deviation of that.

    Only the delay between wheels and gyro shows. A gyro cannot be early: wheels behind it are late
    themselves. A gyro behind the wheels may be late, or the wheels may slip while they speed up: half of it
    is taken for either, and either may be all of it. timing: s, what remains in any case.
    """
    delay, variance = flat[State.GYRO_DELAY], flat[_DELAY]
    if delay <= 0.0:
        return delay, sqrt(timing**2 + variance)
    half = 0.5 * delay
    return half, sqrt(timing**2 + half * half + 0.25 * variance)


def delay_motion(flat: Flat, lead: float, velocity: float, turn_rate: float) -> tuple[float, float]:
    """m and rad that the robot is beyond the pose of a belief, whose heading is of the gyro's time and whose
    place is of the wheels'. lead: s, of `wheels_lead`. velocity, turn_rate: m/s and rad/s."""
    return -lead * velocity, (flat[State.GYRO_DELAY] - lead) * turn_rate


def believed_delay_motion(flat: Flat, timing: float) -> tuple[float, float]:
    """`delay_motion` at the speeds of the belief itself. timing: see `wheels_lead`."""
    lead, _ = wheels_lead(flat, timing)
    return delay_motion(flat, lead, flat[State.WAY] * flat[State.VELOCITY], flat[State.TURN_RATE])
