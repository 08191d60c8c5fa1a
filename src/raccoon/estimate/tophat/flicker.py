"""Lamps on mains flicker at twice its frequency, 100 or 120 Hz: at 200 readings a second every other one is
brighter, or they beat with five readings. RaccoonOS renews its words every 4 ms, so they are of 0 to 4 ms
before they are read, and beat with lamps otherwise: alike or against each other four readings apart.

A few successive readings of such a light have the mean light that is meant, whatever the phase. Noise and
edges do not beat, so the products of steps tell: of lamps those of successive steps are negative, and those
of steps a beat apart positive.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

LAMPS = {100: 2, 120: 5}
"""Hz of lamps, and readings (200 a second) in which they beat."""
TURN = 2.0 * math.cos(0.2 * math.pi)
"""Weight of the middle one of three readings of which 120 Hz leave nothing: it lags by 144 degrees each."""
UNEVEN = 250
"""Hz at which words are renewed that beat with lamps otherwise, whatever the mains."""
EIGHT = 8
"""Such readings, 40 ms, in which a tenth of it is left at the most."""
KINDS = (*LAMPS, UNEVEN)
FOUR = 0.4  # of the power of steps that is alike four readings apart, or against each other: 0 of noise
EVEN = 0.8  # of that, what is alike a beat apart where readings come evenly: they have 1 or 1.25, others 0.66
BEGINS, ENDS = 0.65, 0.35  # alternation: 1 of a pure flicker, 0.25 of noise, 0 of an edge and of other lamps
FORGET = 0.01  # of what was seen, a reading
REACH = 3.0  # standard deviations to which a step counts: edges are longer
MEDIAN_SHARE = 0.6745  # median over standard deviation of normal numbers


def lamps(counts: Array) -> int:
    """Hz at which the light of a drive flickers, 0 where it does not."""
    steps = np.diff(counts)
    limit = REACH * max(1.0, float(np.median(np.abs(steps))) / MEDIAN_SHARE)
    steps = np.where(np.abs(steps) <= limit, steps, 0.0)  # without the edges
    power = float((steps * steps).mean())
    successive, four = _alike(steps, 1), abs(_alike(steps, 4))
    for hertz, beat in LAMPS.items():
        beats = _alike(steps, beat)
        if beats > EVEN * four:  # whatever the noise: of that nothing is alike so far apart
            return hertz if beats - successive > 2.0 * BEGINS * power else 0
    return UNEVEN if four > FOUR * power else 0


def _alike(steps: Array, apart: int) -> float:
    """Mean product of steps so many readings apart."""
    return float((steps[apart:] * steps[:-apart]).mean())


def demodulated(counts: Array, hertz: int) -> Array:
    """Readings of the mean light of each one and of some before, same shape; whole counts no more."""
    light = FULL_SCALE / np.maximum(counts, 1.0) - 1.0
    weights = {100: (1.0, 1.0), 120: (1.0, TURN, 1.0)}.get(hertz, (1.0,) * EIGHT)
    mean = np.convolve(light, weights, "valid") / sum(weights)
    return np.asarray(FULL_SCALE / (1.0 + np.concatenate([mean[: len(weights) - 1], mean])))


class FlickerWatch:
    """The same while driving: `update` with every reading. Uneven words are those of a calibration: what is
    seen in half a second does not tell them from others.

    hertz: of the lamps, 0 where the light does not flicker.
    """

    __slots__ = (
        "_counts",
        "_eight",
        "_four",
        "_last",
        "_older",
        "_power",
        "_steps",
        "_swings",
        "_uneven",
        "hertz",
    )

    def __init__(self, hertz: int = 0) -> None:
        self.hertz = hertz
        self._uneven = hertz == UNEVEN
        self._four = 0.0
        self._eight: deque[tuple[float, float]] = deque(maxlen=EIGHT)  # times and lights
        self._counts: float | None = None
        self._steps = (0.0, 0.0, 0.0, 0.0, 0.0)  # the last ones, the newest first
        self._power = 9.0
        self._swings = {each: 2.0 * self._power if each == hertz else 0.0 for each in LAMPS}
        self._last: tuple[float, float] | None = None  # time and light
        self._older: tuple[float, float] | None = None

    def extra(self, *, to_black: bool) -> int:
        """Readings more that must be on the other side for a change, as one spike is in several means. A dark
        one is less than half of the mean of three."""
        if not self.hertz:
            return 0
        return 1 if to_black or self.hertz != 120 else 2

    def update(self, counts: float) -> None:
        """Take a reading."""
        last, self._counts = self._counts, counts
        if last is None:
            return
        step = counts - last
        power = self._power
        square = step * step
        most = REACH * REACH * power
        if square > most:
            step *= (most / square) ** 0.5
            square = most
        self._power = power + FORGET * (square - power) if power > 1.0 else 1.0 + FORGET * square
        one, two, three, four, five = self._steps
        self._steps = (step, one, two, three, four)
        if self._uneven:
            self._four += FORGET * (step * four - self._four)
            alike = abs(self._four)
            if alike > FOUR * power or alike <= 0.5 * FOUR * power:
                self.hertz = UNEVEN if alike > FOUR * power else 0
            return
        swings = self._swings
        alternate = swings[100] = swings[100] + FORGET * (step * (two - one) - swings[100])
        beat = swings[120] = swings[120] + FORGET * (step * (five - one) - swings[120])
        begins = 2.0 * BEGINS * power
        if alternate > begins:
            self.hertz = 100
        elif beat > begins:
            self.hertz = 120
        elif self.hertz and swings[self.hertz] <= 2.0 * ENDS * power:
            self.hertz = 0

    def mean(self, time: float, light: float) -> tuple[float, float]:
        """Time and light of the mean of the last readings that the lamps do not show in; as they are without
        lamps. Ask once a reading.
        """
        if self._uneven:
            self._eight.append((time, light))
            if not self.hertz:
                return time, light
            share = 1.0 / len(self._eight)
            return share * sum(each[0] for each in self._eight), share * sum(each[1] for each in self._eight)
        last = self._last or (time, light)
        older = self._older or last
        self._last, self._older = (time, light), last
        if self.hertz == 100:
            return 0.5 * (time + last[0]), 0.5 * (light + last[1])
        if self.hertz:
            return last[0], (light + TURN * last[1] + older[1]) / (2.0 + TURN)
        return time, light
