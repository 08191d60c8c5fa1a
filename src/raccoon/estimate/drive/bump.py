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
KEPT_BIAS = 0.2
"""s at rest for which the bias of before counts, where a robot comes to rest: it may stand on a ramp now."""


class BumpWatch:
    """Sums what the accelerometer feels beyond what the wheels and the pitching of the robot explain. Its own
    bias and that of the gyro about the axis are learnt at rest.
    """

    __slots__ = ("_bias", "_known", "_lasting", "_lean", "_pitch_bias", "_standing", "_sum", "_velocity")

    def __init__(self) -> None:
        self._bias = 0.0
        self._known = 0.0
        self._lasting = 0.0
        self._lean = self._pitch_bias = 0.0
        self._standing = False
        self._sum = 0.0
        self._velocity = 0.0

    def interrupt(self, velocity: float) -> None:
        """Nobody felt anything for a while; the wheels' velocity is this now, m/s."""
        self._sum, self._velocity = 0.0, velocity

    def update(
        self, dt: float, forward: float, velocity: float, still: bool, between: float, pitch_rate: float = 0.0
    ) -> bool:
        """True while the robot was bumped.

        forward: m/s2, mean of what the accelerometer read in these dt s. velocity: the wheels' mean in them,
        m/s. between: s from one reading to the next. pitch_rate: rad/s, mean of what the gyro read about the
        axis: above 0 the nose comes down, as at the end of a ramp, and the robot feels less of its weight.
        """
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
            self._velocity = velocity
            return False
        if self._known < KEPT_BIAS:
            self._velocity = velocity
            return False
        self._lean -= GRAVITY * (pitch_rate - self._pitch_bias) * dt
        felt = forward - self._bias - self._lean - (velocity - self._velocity) / dt
        self._velocity = velocity
        self._lasting += (felt - self._lasting) * min(1.0, dt / TILT_TIME)
        self._sum += (felt - self._lasting) * dt
        self._sum -= self._sum * min(1.0, dt / BUMP_TIME)
        return abs(self._sum) > (BUMP_VELOCITY if between <= FINE else COARSE_BUMP_VELOCITY)
