"""Speed profiles: reference position, velocity and acceleration of a motion that starts and ends at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ProfileState:
    """Position, velocity and acceleration along the motion (m or rad, per s, per s2)."""

    position: float
    velocity: float
    acceleration: float


class Trapezoid:
    """Time-optimal profile with limits of speed and acceleration.

    distance: signed. speed, acceleration, deceleration: limits, above 0. If the distance is too short to
    reach the speed, the profile is a triangle. With a acceleration, d deceleration, the triangle's peak is
    sqrt(2 |s| a d / (a + d)).
    """

    __slots__ = (
        "_acceleration",
        "_cruise",
        "_deceleration",
        "_limit",
        "_sign",
        "_speed",
        "_up",
        "distance",
        "duration",
    )

    def __init__(
        self, distance: float, speed: float, acceleration: float, deceleration: float | None = None
    ) -> None:
        deceleration = acceleration if deceleration is None else deceleration
        _check_distance(distance, speed=speed, acceleration=acceleration, deceleration=deceleration)
        self.distance = distance
        length = abs(distance)
        triangle = math.sqrt(2.0 * length * acceleration * deceleration / (acceleration + deceleration))
        peak = min(speed, triangle)
        self._sign = -1.0 if distance < 0.0 else 1.0
        self._acceleration = acceleration
        self._deceleration = deceleration
        self._limit = speed
        self._speed = peak
        self._up = peak / acceleration
        ramps = 0.5 * peak * peak * (1.0 / acceleration + 1.0 / deceleration)
        self._cruise = (length - ramps) / peak if peak > 0.0 else 0.0
        self.duration = self._up + self._cruise + peak / deceleration
        """s from rest to rest."""

    def over(self, distance: float) -> Trapezoid:
        """A profile with the same limits over another distance."""
        return Trapezoid(distance, self._limit, self._acceleration, self._deceleration)

    def at(self, time: float) -> ProfileState:
        """The state `time` s after the start (before it: at rest; after the end: at the goal)."""
        left = self.duration - time
        if time <= 0.0:
            return ProfileState(0.0, 0.0, 0.0)
        if left <= 0.0:
            return ProfileState(self.distance, 0.0, 0.0)
        if time < self._up:
            along = (0.5 * self._acceleration * time * time, self._acceleration * time, self._acceleration)
        elif time < self._up + self._cruise:
            along = (self._speed * (time - 0.5 * self._up), self._speed, 0.0)
        else:
            rest = 0.5 * self._deceleration * left * left
            along = (abs(self.distance) - rest, self._deceleration * left, -self._deceleration)
        return ProfileState(*(self._sign * each for each in along))


class SCurve:
    """Jerk-limited profile: the acceleration changes by at most `jerk` per second.

    distance: signed. speed, acceleration, jerk: limits, above 0 (per s, s2, s3). Ramps of jerk last t_j = a /
    j (or sqrt(v / j) if the acceleration limit is not reached); reaching v takes the distance v (2 t_j + t_a)
    / 2, and a distance too short for both ramps lowers v.
    """

    __slots__ = ("_limits", "_phases", "_sign", "distance", "duration")

    def __init__(self, distance: float, speed: float, acceleration: float, jerk: float) -> None:
        _check_distance(distance, speed=speed, acceleration=acceleration, jerk=jerk)
        self.distance = distance
        self._limits = speed, acceleration, jerk
        self._sign = -1.0 if distance < 0.0 else 1.0
        length = abs(distance)
        ramp, steady, peak = self._ramps(speed, acceleration, jerk)
        if peak * (2.0 * ramp + steady) > length:
            # v^2 / a + v a / j = length if the acceleration limit is reached, else 2 j t_j^3 = length.
            a, j = acceleration, jerk
            peak = 0.5 * a * (math.sqrt(a * a / (j * j) + 4.0 * length / a) - a / j)
            if peak * j < a * a:
                peak = j * (0.5 * length / j) ** (2.0 / 3.0)
            ramp, steady, peak = self._ramps(peak, acceleration, jerk)
        cruise = max(0.0, length - peak * (2.0 * ramp + steady)) / peak if peak > 0.0 else 0.0
        self._phases = _phases(
            (
                (ramp, jerk),
                (steady, 0.0),
                (ramp, -jerk),
                (cruise, 0.0),
                (ramp, -jerk),
                (steady, 0.0),
                (ramp, jerk),
            )
        )
        self.duration = 4.0 * ramp + 2.0 * steady + cruise
        """s from rest to rest."""

    @staticmethod
    def _ramps(speed: float, acceleration: float, jerk: float) -> tuple[float, float, float]:
        """s of a jerk ramp, s at full acceleration between two ramps, and the speed that they reach."""
        if speed * jerk < acceleration * acceleration:
            return math.sqrt(speed / jerk), 0.0, speed
        return acceleration / jerk, speed / acceleration - acceleration / jerk, speed

    def over(self, distance: float) -> SCurve:
        """A profile with the same limits over another distance."""
        return SCurve(distance, *self._limits)

    def at(self, time: float) -> ProfileState:
        """The state `time` s after the start (before it: at rest; after the end: at the goal)."""
        if time <= 0.0:
            return ProfileState(0.0, 0.0, 0.0)
        if time >= self.duration:
            return ProfileState(self.distance, 0.0, 0.0)
        begin, jerk, state = next(phase for phase in reversed(self._phases) if time >= phase[0])
        here = state_after_jerk(state, jerk, time - begin)
        sign = self._sign
        return ProfileState(sign * here.position, sign * here.velocity, sign * here.acceleration)


Profile = Trapezoid | SCurve


def profile(distance: float, speed: float, acceleration: float, jerk: float = 0.0) -> Profile:
    """The profile from rest to rest; a trapezoid for a `jerk` of 0 (no limit)."""
    if jerk > 0.0:
        return SCurve(distance, speed, acceleration, jerk)
    return Trapezoid(distance, speed, acceleration)


def state_after_jerk(state: ProfileState, jerk: float, time: float) -> ProfileState:
    """The state after `time` s of this jerk."""
    s, v, a = state.position, state.velocity, state.acceleration
    return ProfileState(
        s + time * (v + time * (a / 2.0 + time * jerk / 6.0)),
        v + time * (a + time * jerk / 2.0),
        a + time * jerk,
    )


def _phases(pieces: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float, ProfileState], ...]:
    """(start s, jerk, state at the start) of each phase."""
    begin, state, phases = 0.0, ProfileState(0.0, 0.0, 0.0), []
    for seconds, jerk in pieces:
        phases.append((begin, jerk, state))
        begin, state = begin + seconds, state_after_jerk(state, jerk, seconds)
    return tuple(phases)


def _check_distance(distance: float, **limits: float) -> None:
    if not math.isfinite(distance):
        raise ValueError(f"distance is {distance}: it must be finite")
    for name, limit in limits.items():
        if not 0.0 < limit < math.inf:
            raise ValueError(f"{name} is {limit}: it must be above 0")
