"""Recent readings of the start light's sensor, and the shape of the light's rise."""

from __future__ import annotations

import math
from collections import deque
from itertools import takewhile

from raccoon.model.reflectance import FULL_SCALE, light_of

WARM_UP_SHARES = (0.15, 0.75)
"""Shares of the new light between which a bulb's warm-up is timed."""
WARM_UP_SECONDS = 0.24
"""s, longest warm-up: 1.2 time constants of a bulb (0.05..0.2 s); daylight takes longer."""
HISTORY_SECONDS = 1.5
"""s of readings that are kept: a warm-up, and the time that the detector waits after it."""


class History:
    """The last readings, s and counts, oldest first."""

    __slots__ = ("_readings",)

    def __init__(self) -> None:
        self._readings: deque[tuple[float, float]] = deque()

    def add(self, time: float, counts: float) -> None:
        """Keep a reading, and drop the ones that are too old."""
        readings = self._readings
        readings.append((time, counts))
        while len(readings) > 4 and readings[0][0] < time - HISTORY_SECONDS:
            readings.popleft()

    @property
    def time_before(self) -> float:
        """Time of the second last reading, s."""
        return self._readings[-2][0]

    def light_at(self, time: float) -> float:
        """Light of the last reading up to `time` (s), or of the oldest kept one."""
        found = self._readings[0][1]
        for at, counts in reversed(self._readings):
            if at <= time + 1e-6:
                found = counts
                break
        return light_of(found)

    def least_light(self, since: float) -> float:
        """The least light of the readings from `since` (s) on."""
        recent = takewhile(lambda old: old[0] >= since - 1e-6, reversed(self._readings))
        return light_of(max(counts for _, counts in recent))

    def rise_seconds(self, dark: float, lit: float) -> float:
        """Time in which the light last rose through WARM_UP_SHARES on its way from `dark` to `lit`, s.

        Between two readings it is interpolated linearly. Infinite if the rise has no beginning.
        """
        low, high = (dark + share * (lit - dark) for share in WARM_UP_SHARES)
        most, least = (FULL_SCALE / (1.0 + light) for light in (low, high))
        end, after = math.nan, self._readings[-1]
        for reading in reversed(self._readings):
            if reading[1] > least and math.isnan(end):
                end = _crossing_time(reading, after, high)
            if reading[1] > most:
                begin = _crossing_time(reading, after, low)
                # A rise that was already under way has no beginning: it is daylight, learnt halfway.
                moving = self.light_at(begin - WARM_UP_SECONDS) < dark - (low - dark)
                # A lamp may have come on late between the two; then the straight line begins too early.
                return math.inf if moving else end - begin - 0.25 * (after[0] - reading[0])
            after = reading
        return math.inf


def _crossing_time(before: tuple[float, float], after: tuple[float, float], light: float) -> float:
    """Time at which the light passed `light` between two readings (time, counts)."""
    first, last = light_of(before[1]), light_of(after[1])
    share = (light - first) / (last - first) if last > first else 1.0
    return before[0] + min(share, 1.0) * (after[0] - before[0])
