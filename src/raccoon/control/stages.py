"""Speed profile over stages with limits of their own, such as a path with corners: as fast as each allows."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from raccoon.control.profile import Profile, ProfileState, profile, state_after_jerk


@dataclass(frozen=True, slots=True)
class Stage:
    """A part of the distance: length (m), and limits of speed and acceleration (m/s, m/s2); all above 0."""

    length: float
    speed: float
    acceleration: float


class StagedProfile:
    """Profile from rest to rest along `stages`, on each as fast as its limits and the following stages allow.

    jerk: limit in m/s3, 0 for none; with one, the acceleration is 0 at the border of two stages.
    """

    __slots__ = ("_begins", "_jerk", "_phases", "_stages", "distance", "duration")

    def __init__(self, stages: Sequence[Stage], jerk: float = 0.0) -> None:
        for each in stages:
            if not all(0.0 < value < math.inf for value in (each.length, each.speed, each.acceleration)):
                raise ValueError(f"{each}: all of it must be above 0 and finite")
        self._stages, self._jerk = tuple(stages), jerk
        self.distance = math.fsum(each.length for each in stages)
        self.duration = 0.0
        """s from rest to rest."""
        self._begins: list[float] = []
        self._phases: list[tuple[ProfileState, float]] = []  # state at the start of each phase, and its jerk
        here = ProfileState(0.0, 0.0, 0.0)
        for stage, (before, after) in zip(
            stages, itertools.pairwise(_entry_speeds(stages, jerk)), strict=True
        ):
            top = _top_speed(stage, before, after, jerk)
            ramps = _ramp_way(stage, before, top, jerk) + _ramp_way(stage, after, top, jerk)
            here = self._add_speed_change(here, stage, top - before)
            here = self._add_phase(here, max(0.0, stage.length - ramps) / top, 0.0, 0.0)
            here = self._add_speed_change(here, stage, after - top)

    def _add_speed_change(self, here: ProfileState, stage: Stage, change: float) -> ProfileState:
        """Add a change of speed; returns the state after it."""
        ramp, steady = _ramp_times(stage, abs(change), self._jerk)
        jerk = math.copysign(self._jerk, change)
        gain = jerk * ramp if ramp else math.copysign(stage.acceleration, change)
        here = self._add_phase(here, ramp, 0.0, jerk)
        here = self._add_phase(here, steady, gain, 0.0)
        return self._add_phase(here, ramp, gain, -jerk)

    def _add_phase(
        self, here: ProfileState, seconds: float, acceleration: float, jerk: float
    ) -> ProfileState:
        begin = replace(here, acceleration=acceleration)
        if seconds > 0.0:
            self._begins.append(self.duration)
            self._phases.append((begin, jerk))
            self.duration += seconds
        return state_after_jerk(begin, jerk, seconds)

    def over(self, distance: float) -> Profile | StagedProfile:
        """The profile with the same limits over the last `distance` m (or more) to the same end."""
        kept: list[Stage] = []
        for stage in reversed(self._stages):
            if distance > 0.0:
                kept.insert(0, replace(stage, length=min(stage.length, distance)))
                distance -= stage.length
        if kept:
            first = kept[0]
            kept[0] = replace(first, length=first.length + max(0.0, distance))
            return StagedProfile(kept, self._jerk)
        last = self._stages[-1]
        return profile(distance, last.speed, last.acceleration, self._jerk)

    def at(self, time: float) -> ProfileState:
        """The state `time` s after the start (before it: at rest; after the end: at the goal)."""
        if time <= 0.0:
            return ProfileState(0.0, 0.0, 0.0)
        if time >= self.duration:
            return ProfileState(self.distance, 0.0, 0.0)
        index = bisect_right(self._begins, time) - 1
        state, jerk = self._phases[index]
        return state_after_jerk(state, jerk, time - self._begins[index])


def _ramp_times(stage: Stage, change: float, jerk: float) -> tuple[float, float]:
    """s of each of the two ramps of jerk (0 without a limit), and s of constant acceleration."""
    if jerk == 0.0:
        return 0.0, change / stage.acceleration
    if change * jerk < stage.acceleration**2:
        return math.sqrt(change / jerk), 0.0
    return stage.acceleration / jerk, change / stage.acceleration - stage.acceleration / jerk


def _ramp_way(stage: Stage, slow: float, fast: float, jerk: float) -> float:
    """m that a change between two speeds takes."""
    ramp, steady = _ramp_times(stage, fast - slow, jerk)
    return 0.5 * (slow + fast) * (2.0 * ramp + steady)


def _top_speed(stage: Stage, before: float, after: float, jerk: float) -> float:
    """The highest speed on a stage with these entry and exit speeds."""

    def fits(top: float) -> bool:
        ways = (_ramp_way(stage, slow, top, jerk) for slow in (before, after))
        return sum(ways) <= stage.length

    return stage.speed if fits(stage.speed) else _bisect_highest(fits, max(before, after), stage.speed)


def _reachable_speed(stage: Stage, slow: float, wanted: float, jerk: float) -> float:
    """The highest speed up to `wanted` that the stage is long enough to reach from `slow`."""

    def fits(fast: float) -> bool:
        return _ramp_way(stage, slow, fast, jerk) <= stage.length

    return wanted if wanted <= slow or fits(wanted) else _bisect_highest(fits, slow, wanted)


def _bisect_highest(fits: Callable[[float], bool], low: float, high: float) -> float:
    """The highest number that fits, if `low` does and `high` does not."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def _entry_speeds(stages: Sequence[Stage], jerk: float) -> list[float]:
    """Entry speed of each stage, m/s, and 0 after the last one."""
    speeds = [0.0, *(min(a.speed, b.speed) for a, b in itertools.pairwise(stages)), 0.0]
    for index, stage in enumerate(stages):
        speeds[index + 1] = _reachable_speed(stage, speeds[index], speeds[index + 1], jerk)
    for index, stage in reversed(list(enumerate(stages))):
        speeds[index] = _reachable_speed(stage, speeds[index + 1], speeds[index], jerk)
    return speeds
