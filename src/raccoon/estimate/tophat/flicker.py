"""Lamps on mains flicker at twice its frequency, 100 or 120 Hz: at 200 readings a second every other one is
brighter, or they beat with five readings.

A few successive readings of such a light have the mean light that is meant, whatever the phase. Noise and
edges do not beat, so the products of steps tell: of lamps those of successive steps are negative, and those
of steps a beat apart positive.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

LAMPS = {100: 2, 120: 5}
"""Hz of lamps, and readings (200 a second) in which they beat."""
TURN = 2.0 * math.cos(0.2 * math.pi)
"""Weight of the middle one of three readings of which 120 Hz leave nothing: it lags by 144 degrees each."""
BEGINS, ENDS = 0.65, 0.35  # alternation: 1 of a pure flicker, 0.25 of noise, 0 of an edge and of other lamps
FORGET = 0.01  # of what was seen, a reading
REACH = 3.0  # standard deviations to which a step counts: edges are longer
MEDIAN_SHARE = 0.6745  # median over standard deviation of normal numbers


def lamps(counts: Array) -> int:
    """Hz at which the light of a drive flickers, 0 where it does not."""
    steps = np.diff(counts)
    limit = REACH * max(1.0, float(np.median(np.abs(steps))) / MEDIAN_SHARE)
    steps = np.where(np.abs(steps) <= limit, steps, 0.0)  # without the edges
    most = 2.0 * BEGINS * float((steps * steps).mean())
    successive = float((steps[1:] * steps[:-1]).mean())
    for hertz, beat in LAMPS.items():
        if float((steps[beat:] * steps[:-beat]).mean()) - successive > most:
            return hertz
    return 0


def demodulated(counts: Array, hertz: int) -> Array:
    """Readings of the mean light of each one and the one or two before, same shape; whole counts no more."""
    light = FULL_SCALE / np.maximum(counts, 1.0) - 1.0
    weights = (1.0, 1.0) if hertz == 100 else (1.0, TURN, 1.0)
    mean = np.convolve(light, weights, "valid") / sum(weights)
    return np.asarray(FULL_SCALE / (1.0 + np.concatenate([mean[: len(weights) - 1], mean])))


class FlickerWatch:
    """The same while driving: `update` with every reading.

    hertz: of the lamps, 0 where the light does not flicker.
    """

    __slots__ = ("_counts", "_last", "_older", "_power", "_steps", "_swings", "hertz")

    def __init__(self, hertz: int = 0) -> None:
        self.hertz = hertz
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
        return 1 if to_black or self.hertz == 100 else 2

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
        last = self._last or (time, light)
        older = self._older or last
        self._last, self._older = (time, light), last
        if self.hertz == 100:
            return 0.5 * (time + last[0]), 0.5 * (light + last[1])
        if self.hertz:
            return last[0], (light + TURN * last[1] + older[1]) / (2.0 + TURN)
        return time, light
