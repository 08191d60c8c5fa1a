"""A bulb that warms up for a second or two, told from daylight and from shadows that leave by how it does so.

A bulb comes to its light as what heats up does: fast at first, and the slower the nearer it gets. For an
exponential the last part of the way, from 75 to 90 % of the light, takes 0.75 of the time from 15 to 75 %;
for a filament that loses its heat by radiation it is half. For light that comes evenly it is 0.25, and for a
shadow or a cloud whose edge is soft 0.30 to 0.36. A lamp is near its sensor, so it is also many times as
bright as the light before it, which no shadow is dark enough for.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from statistics import median

from raccoon.model.reflectance import light_of

MEAN_SECONDS = 0.05  # of readings that are taken together: noise, flashes and flicker are gone then
KEPT_SECONDS = 4.0  # a warm-up, and some time before and after it
HALF_WINDOW = 3  # of these means, in which the light of a bulb that is warm must not change
STEADY_RATIO = 1.03  # light over the light HALF means before, below which it has come
BRIGHT_RATIO = 10.0
"""Light over the brightest before, above which it may be a bulb; a deep shadow leaves 1 of 5."""
RISE_SECONDS = (0.1, 0.9)  # from 15 to 75 %: time constants of 0.08 to 0.75 s
TAIL_RATIO = (0.42, 0.85)  # time from 75 to 90 % over that from 15 to 75 %
SETTLING_SECONDS = 0.5  # for which light that has come is looked back on
PATIENCE_SECONDS = 3.0  # s for which light that rises may yet become a bulb's


class SlowBulb:
    """Looks back on how the light came. Feed it every reading."""

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
        """Whether the light still goes up, or did until a moment ago."""
        return time - self._last_rise < SETTLING_SECONDS

    def most_light(self, since: float, before: float) -> float:
        """Most light between two times (s) that stayed for two means, as no flash does; else 0."""
        lights = [light for begin, light in self._means if since <= begin <= before]
        return max((min(pair) for pair in pairwise(lights)), default=0.0)

    def is_warm(self, dark: float) -> bool:
        """Whether the light has come to rest, and came as a bulb's. dark: the brightest before it."""
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
        """Light of the last HALF means, and of as many before them; equal where there are fewer."""
        lights = [light for _, light in self._means][-2 * HALF_WINDOW :]
        if len(lights) < 2 * HALF_WINDOW:
            return 1.0, 1.0
        return sum(lights[HALF_WINDOW:]) / HALF_WINDOW, sum(lights[:HALF_WINDOW]) / HALF_WINDOW

    def _time_passed(self, light: float) -> float | None:
        """When it was last below this light and passed it, s; None where it never was."""
        after = self._means[-1]
        for mean in reversed(self._means):
            if mean[1] < light:
                share = (light - mean[1]) / (after[1] - mean[1]) if after[1] > mean[1] else 1.0
                return mean[0] + min(share, 1.0) * (after[0] - mean[0])
            after = mean
        return None
