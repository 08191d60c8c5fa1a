"""Whether the robot was bumped: the accelerometer against the wheels, and the gyro about the axis."""

from __future__ import annotations

from raccoon.core.readings import GRAVITY

BUMP_VELOCITY, COARSE_BUMP_VELOCITY = 0.06, 0.1
"""m/s that the accelerometer sees and the wheels do not: with a reading every 5 ms, and where they come so
seldom that what lies between two of them is not seen. Simulated driving stays below 0.03 and 0.075; a chassis
that nods adds some hundredths."""
FINE = 0.008
"""s between two readings up to which they are the former."""
BUMP_TIME = 0.08
"""s over which it is summed."""
TILT_TIME = 0.3
"""s over which what lasts is learnt to be no blow: on a ramp the robot feels its own weight."""
OTHERWISE = 2.0
"""Times the way that the sum makes of a blow, as it forgets meanwhile: deviation of how far the robot went
otherwise than its wheels. Pushes of 30 to 100 N for 0.05 to 0.3 s make 1.8 to 3.3 of it."""
OFF_MIDDLE = 0.08
"""m by which an accelerometer may sit beside the middle of the axis: where the wheels turn the robot it feels
so much of that, too."""
LATER = 0.1
"""Of how much the wheels changed their speed lately, what the accelerometer may still feel of it: at a full
reversal of duties it comes up to 8 ms later."""
JOLT = 3.4
"""m/s2 of a change of both duties by 1, half of what a full one makes: a reading that is the first to feel it
counts for all the time since the one before, and the wheels are not read to have changed yet."""
KEPT_BIAS = 0.2
"""s at rest for which the bias of before counts, where a robot comes to rest: it may stand on a ramp now."""


class BumpWatch:
    """Sums what the accelerometer feels beyond what the wheels and the pitching of the robot explain. Its own
    bias and that of the gyro about the axis are learnt at rest.

    It watches one direction: ahead, as the arguments say, or to the left, with no velocity there. doubt: m^2
    by which the last step adds to the variance of the place in that direction, because of a blow.
    """

    __slots__ = (
        "_bias",
        "_changed",
        "_counted",
        "_known",
        "_lasting",
        "_lean",
        "_pitch_bias",
        "_standing",
        "_sum",
        "_turn_rate",
        "_turned",
        "_velocity",
        "_way",
        "doubt",
    )

    def __init__(self) -> None:
        self.doubt = self._way = self._counted = 0.0
        self._turn_rate = self._turned = self._changed = 0.0
        self._bias = 0.0
        self._known = 0.0
        self._lasting = 0.0
        self._lean = self._pitch_bias = 0.0
        self._standing = False
        self._sum = 0.0
        self._velocity = 0.0

    def interrupt(self, velocity: float, turn_rate: float = 0.0) -> None:
        """Nobody felt anything for a while; the wheels' motion is this now, m/s and rad/s."""
        self._sum, self._velocity, self._turn_rate = 0.0, velocity, turn_rate
        self.doubt = self._way = self._counted = self._turned = self._changed = 0.0

    def update(
        self,
        dt: float,
        forward: float,
        velocity: float,
        still: bool,
        between: float,
        pitch_rate: float = 0.0,
        turn_rate: float = 0.0,
        jolt: float = 0.0,
    ) -> bool:
        """True while the robot was bumped.

        forward: m/s2, mean of what the accelerometer read in these dt s. velocity: the wheels' mean in them,
        m/s. between: s from one reading to the next. pitch_rate: rad/s, mean of what the gyro read about the
        axis: above 0 the nose comes down, as at the end of a ramp, and the robot feels less of its weight.
        turn_rate: rad/s, as the wheels turn it. jolt: by how much both duties were changed at once lately.
        """
        self.doubt = 0.0
        if still and not self._standing:
            self._bias += self._lean + self._lasting  # as it leans now, it will start
            self._sum = self._lasting = self._lean = 0.0
            self._known = min(self._known, KEPT_BIAS)
        self._standing = still
        if still:
            self._known += dt
            share = min(1.0, dt / min(self._known, 2.0))
            self._bias += (forward - self._bias) * share
            self._pitch_bias += (pitch_rate - self._pitch_bias) * share
            self._velocity, self._turn_rate = velocity, turn_rate
            return False
        if self._known < KEPT_BIAS:
            self._velocity, self._turn_rate = velocity, turn_rate
            return False
        self._lean -= GRAVITY * (pitch_rate - self._pitch_bias) * dt
        change, keep = velocity - self._velocity, 1.0 - min(1.0, dt / BUMP_TIME)
        felt = forward - self._bias - self._lean - change / dt
        self._lasting += (felt - self._lasting) * min(1.0, dt / TILT_TIME)
        self._sum = (self._sum + (felt - self._lasting) * dt) * keep
        self._turned = (self._turned + turn_rate - self._turn_rate) * keep
        self._changed = (self._changed + change) * keep
        self._velocity, self._turn_rate = velocity, turn_rate
        limit = BUMP_VELOCITY if between <= FINE else COARSE_BUMP_VELOCITY
        limit += OFF_MIDDLE * abs(self._turned) + LATER * abs(self._changed) + JOLT * jolt * between
        return self._is_blow(dt, limit)

    def _is_blow(self, dt: float, limit: float) -> bool:
        """Whether the sum is that of a blow; count the way that it makes, from half of that on."""
        size, before = abs(self._sum), self._counted
        self._way = self._way + OTHERWISE * size * dt if size > 0.5 * limit else 0.0
        self._counted = self._way if size > limit else min(before, self._way)
        self.doubt = max(0.0, self._counted**2 - before**2)
        return size > limit
