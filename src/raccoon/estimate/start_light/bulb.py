"""Detection of a bulb that warms up for a second or two, distinguished from daylight and shadows by the shape
of its rise.

A bulb's light rises like anything that heats up: fast at first, and slower the nearer it is to its end. For
an exponential the last part of the rise, from 75 to 90 % of the light, takes 0.75 of the time from 15 to 75
%; for a filament that loses its heat by radiation 0.5. For evenly rising light it is 0.25, and for a shadow
or a cloud with a soft edge 0.30 to 0.36. A lamp is near its sensor, so it is also many times as bright as the
light before it, more than the end of any shadow.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from statistics import median

from raccoon.model.reflectance import light_of

MEAN_SECONDS = 0.05  # s of readings in one median: removes noise, flashes and flicker
KEPT_SECONDS = 4.0  # s: a warm-up, and some time before and after it
HALF_WINDOW = 3  # number of medians in which the light of a warm bulb must be constant
STEADY_RATIO = 1.03  # light over that HALF_WINDOW medians before, below which it is constant
BRIGHT_RATIO = 10.0
"""Least light over the brightest light before; a deep shadow leaves 1 of 5."""
RISE_SECONDS = (0.1, 0.9)  # from 15 to 75 %: time constants of 0.08 to 0.75 s
TAIL_RATIO = (0.42, 0.85)  # time from 75 to 90 % over that from 15 to 75 %
SETTLING_SECONDS = 0.5  # s for which constant light is still examined
PATIENCE_SECONDS = 3.0  # s in which rising light may become a bulb's


class SlowBulb:
    """Examines how the light rose. Call `add` with every reading."""

    __slots__ = ("_bucket", "_bucket_start", "_has_new_mean", "_last_rise", "_means")

    def __init__(self) -> None:
        self._bucket: list[float] = []
        self._bucket_start = 0.0
        self._means: deque[tuple[float, float]] = deque()  # (time, light), oldest first
        self._has_new_mean = False
        self._last_rise = -math.inf

    def add(self, time: float, counts: float) -> None:
        """Take a reading, s and counts."""
        self._has_new_mean = False
        if self._bucket and time - self._bucket_start >= MEAN_SECONDS - 1e-6:
            means = self._means
            means.append((self._bucket_start, light_of(median(self._bucket))))
            while means[0][0] < time - KEPT_SECONDS:
                means.popleft()
            self._bucket.clear()
            self._has_new_mean = True
            now, before = self._window_means()
            if now > STEADY_RATIO * before:
                self._last_rise = time
        if not self._bucket:
            self._bucket_start = time
        self._bucket.append(counts)

    def is_rising(self, time: float) -> bool:
        """Whether the light is rising, or was until a moment ago."""
        return time - self._last_rise < SETTLING_SECONDS

    def most_light(self, since: float, before: float) -> float:
        """Most light between two times (s) that lasted for two medians, as no flash does; else 0."""
        lights = [light for begin, light in self._means if since <= begin <= before]
        return max((min(pair) for pair in pairwise(lights)), default=0.0)

    def is_warm(self, dark: float) -> bool:
        """Whether the light has become constant after rising like a bulb's. dark: the brightest light before
        it."""
        if not self._has_new_mean or len(self._means) <= 2 * HALF_WINDOW:
            return False
        now, before = self._window_means()
        lit = 0.5 * (now + before)
        if lit < BRIGHT_RATIO * dark or not 1.0 / STEADY_RATIO < now / before < STEADY_RATIO:
            return False
        begin, middle, end = (self._time_passed(dark + share * (lit - dark)) for share in (0.15, 0.75, 0.90))
        if begin is None or middle is None or end is None:
            return False
        rise = middle - begin
        return (
            RISE_SECONDS[0] <= rise <= RISE_SECONDS[1]
            and TAIL_RATIO[0] * rise < end - middle < TAIL_RATIO[1] * rise
        )

    def _window_means(self) -> tuple[float, float]:
        """Light of the last HALF_WINDOW medians, and of as many before them; equal for too few."""
        lights = [light for _, light in self._means][-2 * HALF_WINDOW :]
        if len(lights) < 2 * HALF_WINDOW:
            return 1.0, 1.0
        return sum(lights[HALF_WINDOW:]) / HALF_WINDOW, sum(lights[:HALF_WINDOW]) / HALF_WINDOW

    def _time_passed(self, light: float) -> float | None:
        """Last time at which the light rose through this value, s; None if it never did."""
        after = self._means[-1]
        for mean in reversed(self._means):
            if mean[1] < light:
                share = (light - mean[1]) / (after[1] - mean[1]) if after[1] > mean[1] else 1.0
                return mean[0] + min(share, 1.0) * (after[0] - mean[0])
            after = mean
        return None
