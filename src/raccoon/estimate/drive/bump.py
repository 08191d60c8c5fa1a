"""Whether the robot was bumped: the accelerometer against the wheels, and the gyro about the axis."""

from __future__ import annotations

from raccoon.core.readings import GRAVITY

BUMP_VELOCITY, COARSE_BUMP_VELOCITY = 0.06, 0.1
"""m/s that the accelerometer sees and the wheels do not: with a reading every 5 ms, and where they come so
seldom that what lies between two of them is not seen. Simulated driving stays below 0.03 and 0.075; a chassis
that nods adds some hundredths."""
FINE_PERIOD_S = 0.008
"""s between two readings up to which they are the former."""
BUMP_TIME_S = 0.08
"""s over which it is summed."""
TILT_TIME_S = 0.3
"""s over which what lasts is learnt to be no blow: on a ramp the robot feels its own weight."""
WAY_STD_FACTOR = 2.0
"""Times the way that the sum makes of a blow, as it forgets meanwhile: deviation of how far the robot went
otherwise than its wheels. Pushes of 30 to 100 N for 0.05 to 0.3 s make 1.8 to 3.3 of it."""
MAX_ACCELEROMETER_OFFSET_M = 0.08
"""m by which an accelerometer may sit beside the middle of the axis: where the wheels turn the robot it feels
so much of that, too."""
LATE_SPEED_CHANGE_SHARE = 0.1
"""Of how much the wheels changed their speed lately, what the accelerometer may still feel of it: at a full
reversal of duties it comes up to 8 ms later."""
JOLT_ACCELERATION = 3.4
"""m/s2 of a change of both duties by 1, half of what a full one makes: a reading that is the first to feel it
counts for all the time since the one before, and the wheels are not read to have changed yet."""
KEPT_BIAS_S = 0.2
"""s at rest for which the bias of before counts, where a robot comes to rest: it may stand on a ramp now."""


class BumpWatch:
    """Sums what the accelerometer feels beyond what the wheels and the pitching of the robot explain. Its own
    bias and that of the gyro about the axis are learnt at rest.

    It watches one direction: ahead, as the arguments say, or to the left, with no velocity there. doubt: m^2
    by which the last step adds to the variance of the place in that direction, because of a blow.
    """

    __slots__ = (
        "_accel_bias",
        "_bias_seconds",
        "_doubted_way",
        "_gravity_ahead",
        "_lasting_accel",
        "_pitch_bias",
        "_turn_rate",
        "_turn_rate_change",
        "_unexplained_velocity",
        "_unexplained_way",
        "_velocity",
        "_velocity_change",
        "_was_still",
        "place_variance",
    )

    def __init__(self) -> None:
        self.place_variance = self._unexplained_way = self._doubted_way = 0.0
        self._turn_rate = self._turn_rate_change = self._velocity_change = 0.0
        self._accel_bias = 0.0
        self._bias_seconds = 0.0
        self._lasting_accel = 0.0
        self._gravity_ahead = self._pitch_bias = 0.0
        self._was_still = False
        self._unexplained_velocity = 0.0
        self._velocity = 0.0

    def restart(self, velocity: float, turn_rate: float = 0.0) -> None:
        """Nobody felt anything for a while; the wheels' motion is this now, m/s and rad/s."""
        self._unexplained_velocity, self._velocity, self._turn_rate = 0.0, velocity, turn_rate
        self.place_variance = self._unexplained_way = self._doubted_way = self._turn_rate_change = (
            self._velocity_change
        ) = 0.0

    def update(
        self,
        dt: float,
        forward: float,
        velocity: float,
        still: bool,
        sample_period: float,
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
        self.place_variance = 0.0
        if still and not self._was_still:
            self._accel_bias += self._gravity_ahead + self._lasting_accel  # as it leans now, it will start
            self._unexplained_velocity = self._lasting_accel = self._gravity_ahead = 0.0
            self._bias_seconds = min(self._bias_seconds, KEPT_BIAS_S)
        self._was_still = still
        if still:
            self._bias_seconds += dt
            share = min(1.0, dt / min(self._bias_seconds, 2.0))
            self._accel_bias += (forward - self._accel_bias) * share
            self._pitch_bias += (pitch_rate - self._pitch_bias) * share
            self._velocity, self._turn_rate = velocity, turn_rate
            return False
        if self._bias_seconds < KEPT_BIAS_S:
            self._velocity, self._turn_rate = velocity, turn_rate
            return False
        self._gravity_ahead -= GRAVITY * (pitch_rate - self._pitch_bias) * dt
        speed_change, keep = velocity - self._velocity, 1.0 - min(1.0, dt / BUMP_TIME_S)
        unexplained_accel = forward - self._accel_bias - self._gravity_ahead - speed_change / dt
        self._lasting_accel += (unexplained_accel - self._lasting_accel) * min(1.0, dt / TILT_TIME_S)
        self._unexplained_velocity = (
            self._unexplained_velocity + (unexplained_accel - self._lasting_accel) * dt
        ) * keep
        self._turn_rate_change = (self._turn_rate_change + turn_rate - self._turn_rate) * keep
        self._velocity_change = (self._velocity_change + speed_change) * keep
        self._velocity, self._turn_rate = velocity, turn_rate
        limit = BUMP_VELOCITY if sample_period <= FINE_PERIOD_S else COARSE_BUMP_VELOCITY
        limit += (
            MAX_ACCELEROMETER_OFFSET_M * abs(self._turn_rate_change)
            + LATE_SPEED_CHANGE_SHARE * abs(self._velocity_change)
            + JOLT_ACCELERATION * jolt * sample_period
        )
        return self._is_blow(dt, limit)

    def _is_blow(self, dt: float, limit: float) -> bool:
        """Whether the sum is that of a blow; count the way that it makes, from half of that on."""
        unexplained, doubted_before = abs(self._unexplained_velocity), self._doubted_way
        self._unexplained_way = (
            self._unexplained_way + WAY_STD_FACTOR * unexplained * dt if unexplained > 0.5 * limit else 0.0
        )
        self._doubted_way = (
            self._unexplained_way if unexplained > limit else min(doubted_before, self._unexplained_way)
        )
        self.place_variance = max(0.0, self._doubted_way**2 - doubted_before**2)
        return unexplained > limit
