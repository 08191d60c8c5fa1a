"""Detection of bumps: the accelerometer against the wheels, and the gyro's pitch or roll rate."""

from __future__ import annotations

from raccoon.core.readings import GRAVITY

BUMP_VELOCITY, COARSE_BUMP_VELOCITY = 0.06, 0.1
"""m/s of change of velocity that the accelerometer sees and the wheels do not, thresholds of a bump: for a
reading every 5 ms, and for readings too far apart to show what happens between them. Simulated driving stays
below 0.03 and 0.075; a nodding chassis adds some hundredths."""
FINE_PERIOD_S = 0.008
"""s between two readings up to which the first threshold holds."""
BUMP_TIME_S = 0.08
"""s, time constant of the sum."""
TILT_TIME_S = 0.3
"""s, time constant with which a lasting acceleration is learnt not to be a bump: on a ramp it is gravity."""
WAY_STD_FACTOR = 2.0
"""Standard deviation of the distance that the robot moved otherwise than its wheels, as a factor on the
distance by the sum, which decays meanwhile. For pushes of 30 to 100 N for 0.05 to 0.3 s the factor is 1.8 to
3.3."""
MAX_ACCELEROMETER_OFFSET_M = 0.08
"""m, largest offset of the accelerometer from the middle of the axle; in a turn it adds so much
acceleration."""
LATE_SPEED_CHANGE_SHARE = 0.1
"""Share of the wheels' recent change of speed that the accelerometer may still have to feel: at a full
reversal of duties it is up to 8 ms late."""
JOLT_ACCELERATION = 3.4
"""m/s2 for a change of both duties by 1, half of what a full change makes. The first reading that feels it
counts for the whole time since the one before, while the wheels' readings do not show it yet."""
KEPT_BIAS_S = 0.2
"""s at rest that the previous bias counts for when the robot comes to rest (it may stand on a ramp now), and
that a known bias needs."""


class BumpWatch:
    """Sums the acceleration that neither the wheels nor the pitching of the robot explain. The biases of
    accelerometer and gyro are learnt at rest.

    It watches one direction: forwards, with the arguments as named, or to the left, with a velocity of 0.
    place_variance: m^2 that the last step adds to the variance of the position in that direction, because of
    a bump.
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
        """Start again after a gap in the readings, at the wheels' present velocity (m/s) and turn rate
        (rad/s)."""
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
        """True while the robot is bumped.

        forward: m/s2, mean of the accelerometer over these dt s. velocity: m/s, mean of the wheels.
        sample_period: s between two readings. turn_rate: rad/s, by the wheels.
        pitch_rate: rad/s, mean of the gyro about the axle; positive: the nose goes down, as at the end of a
        ramp, and the robot feels less of gravity.
        jolt: recent change of both duties at once.
        """
        self.place_variance = 0.0
        if still and not self._was_still:
            self._accel_bias += self._gravity_ahead + self._lasting_accel  # it starts as it leans now
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
        """Whether the sum exceeds the limit of a bump. Counts the distance, from half of the limit on."""
        unexplained, doubted_before = abs(self._unexplained_velocity), self._doubted_way
        self._unexplained_way = (
            self._unexplained_way + WAY_STD_FACTOR * unexplained * dt if unexplained > 0.5 * limit else 0.0
        )
        self._doubted_way = (
            self._unexplained_way if unexplained > limit else min(doubted_before, self._unexplained_way)
        )
        self.place_variance = max(0.0, self._doubted_way**2 - doubted_before**2)
        return unexplained > limit
