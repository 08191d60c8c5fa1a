"""Detection and averaging of mains flicker.

Lamps on mains flicker at twice its frequency, 100 or 120 Hz: at 200 readings a second every other one is
brighter, or they beat with a period of five readings. RaccoonOS renews its words every 4 ms, so they are 0 to
4 ms old when read, and beat with lamps in another way: correlated, positively or negatively, four readings
apart.

A few successive readings of such a light average to the mean light, whatever the phase. Noise and edges do
not beat, so products of steps detect lamps: those of successive steps are negative, those of steps a beat
apart positive.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

LAMP_PERIODS = {100: 2, 120: 5}
"""By Hz of lamps, the period of the beat in readings (200 a second)."""
MIDDLE_WEIGHT = 2.0 * math.cos(0.2 * math.pi)
"""Weight of the middle one of three readings whose weighted mean cancels 120 Hz: it is 144 degrees per
reading."""
UNEVEN_HZ = 250
"""Hz at which such words are renewed; they beat in the other way, whatever the mains."""
UNEVEN_READINGS = 8
"""Readings averaged for such words (40 ms); at most a tenth of the flicker remains."""
FLICKER_HZ = (*LAMP_PERIODS, UNEVEN_HZ)
UNEVEN_CORRELATION = 0.4
"""Threshold on the absolute correlation of steps four readings apart, as a share of their power: 0 for
noise."""
EVEN_CORRELATION = 0.8
"""Threshold on the correlation a beat apart over that one, for readings at even times: they have 1 or 1.25,
others 0.66."""
FLICKER_BEGINS, FLICKER_ENDS = 0.65, 0.35
"""Thresholds on the alternation: 1 for pure flicker, 0.25 for noise, 0 for an edge and for other lamps."""
FORGETTING = 0.01  # of the averages, per reading
STEP_LIMIT_SDS = 3.0  # standard deviations; steps are limited to it, as edges are longer
MEDIAN_SHARE = 0.6745  # median over standard deviation of absolute normal numbers


def detect_flicker_hz(counts: Array) -> int:
    """Hz at which the light of a drive flickers; 0 if it does not."""
    steps = np.diff(counts)
    limit = STEP_LIMIT_SDS * max(1.0, float(np.median(np.abs(steps))) / MEDIAN_SHARE)
    steps = np.where(np.abs(steps) <= limit, steps, 0.0)  # without edges
    power = float((steps * steps).mean())
    successive, four = _step_correlation(steps, 1), abs(_step_correlation(steps, 4))
    for hertz, beat in LAMP_PERIODS.items():
        beats = _step_correlation(steps, beat)
        if beats > EVEN_CORRELATION * four:  # noise has no correlation so far apart
            return hertz if beats - successive > 2.0 * FLICKER_BEGINS * power else 0
    return UNEVEN_HZ if four > UNEVEN_CORRELATION * power else 0


def _step_correlation(steps: Array, apart: int) -> float:
    """Mean product of steps `apart` readings apart."""
    return float((steps[apart:] * steps[:-apart]).mean())


def average_out_flicker(counts: Array, hertz: int) -> Array:
    """Readings of the mean light over each reading and some before it, same shape; no longer whole counts."""
    light = FULL_SCALE / np.maximum(counts, 1.0) - 1.0
    weights = {100: (1.0, 1.0), 120: (1.0, MIDDLE_WEIGHT, 1.0)}.get(hertz, (1.0,) * UNEVEN_READINGS)
    mean = np.convolve(light, weights, "valid") / sum(weights)
    return np.asarray(FULL_SCALE / (1.0 + np.concatenate([mean[: len(weights) - 1], mean])))


class FlickerWatch:
    """The same while driving: call `update` with every reading. For uneven words it relies on the
    calibration: half a second of readings does not distinguish them from even ones.

    hertz: of the lamps; 0 if the light does not flicker.
    """

    __slots__ = (
        "_correlations",
        "_is_uneven",
        "_last",
        "_last_counts",
        "_older",
        "_step_power",
        "_steps",
        "_uneven_correlation",
        "_uneven_readings",
        "hertz",
    )

    def __init__(self, hertz: int = 0) -> None:
        self.hertz = hertz
        self._is_uneven = hertz == UNEVEN_HZ
        self._uneven_correlation = 0.0
        self._uneven_readings: deque[tuple[float, float]] = deque(maxlen=UNEVEN_READINGS)  # times and lights
        self._last_counts: float | None = None
        self._steps = (0.0, 0.0, 0.0, 0.0, 0.0)  # the last ones, the newest first
        self._step_power = 9.0
        self._correlations = {each: 2.0 * self._step_power if each == hertz else 0.0 for each in LAMP_PERIODS}
        self._last: tuple[float, float] | None = None  # time and light
        self._older: tuple[float, float] | None = None

    def extra_debounce(self, *, to_black: bool) -> int:
        """Additional readings on the other side that a change needs, as one spike is in several means. A dark
        one has less than half of the weight in a mean of three."""
        if not self.hertz:
            return 0
        return 1 if to_black or self.hertz != 120 else 2

    def update(self, counts: float) -> None:
        """Take a reading."""
        last, self._last_counts = self._last_counts, counts
        if last is None:
            return
        step = counts - last
        power = self._step_power
        square = step * step
        most = STEP_LIMIT_SDS * STEP_LIMIT_SDS * power
        if square > most:
            step *= (most / square) ** 0.5
            square = most
        self._step_power = power + FORGETTING * (square - power) if power > 1.0 else 1.0 + FORGETTING * square
        one, two, three, four, five = self._steps
        self._steps = (step, one, two, three, four)
        if self._is_uneven:
            self._uneven_correlation += FORGETTING * (step * four - self._uneven_correlation)
            alike = abs(self._uneven_correlation)
            if alike > UNEVEN_CORRELATION * power or alike <= 0.5 * UNEVEN_CORRELATION * power:
                self.hertz = UNEVEN_HZ if alike > UNEVEN_CORRELATION * power else 0
            return
        swings = self._correlations
        alternate = swings[100] = swings[100] + FORGETTING * (step * (two - one) - swings[100])
        beat = swings[120] = swings[120] + FORGETTING * (step * (five - one) - swings[120])
        begins = 2.0 * FLICKER_BEGINS * power
        if alternate > begins:
            self.hertz = 100
        elif beat > begins:
            self.hertz = 120
        elif self.hertz and swings[self.hertz] <= 2.0 * FLICKER_ENDS * power:
            self.hertz = 0

    def mean(self, time: float, light: float) -> tuple[float, float]:
        """Time and light of the mean of the last readings in which the flicker cancels; unchanged without
        flicker. Call it once for each reading."""
        if self._is_uneven:
            self._uneven_readings.append((time, light))
            if not self.hertz:
                return time, light
            share = 1.0 / len(self._uneven_readings)
            return share * sum(each[0] for each in self._uneven_readings), share * sum(
                each[1] for each in self._uneven_readings
            )
        last = self._last or (time, light)
        older = self._older or last
        self._last, self._older = (time, light), last
        if self.hertz == 100:
            return 0.5 * (time + last[0]), 0.5 * (light + last[1])
        if self.hertz:
            return last[0], (light + MIDDLE_WEIGHT * last[1] + older[1]) / (2.0 + MIDDLE_WEIGHT)
        return time, light
