"""Lamps on mains flicker at 100 Hz: at 200 readings a second every other one is brighter.

Two successive readings of such a light have the mean light that is meant, whatever the phase. Noise and
edges do not alternate, so the products of successive steps tell: of readings that alternate they are
negative, and of steps two apart positive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.model.reflectance import FULL_SCALE

Array = NDArray[np.float64]

BEGINS, ENDS = 0.65, 0.35  # alternation: 1 of a pure flicker, 0.25 of noise, 0 of an edge
FORGET = 0.01  # of what was seen, a reading
REACH = 3.0  # standard deviations to which a step counts: edges are longer
MEDIAN_SHARE = 0.6745  # median over standard deviation of normal numbers


def alternates(counts: Array) -> bool:
    """Whether the readings of a drive flicker."""
    steps = np.diff(counts)
    limit = REACH * max(1.0, float(np.median(np.abs(steps))) / MEDIAN_SHARE)
    steps = np.where(np.abs(steps) <= limit, steps, 0.0)  # without the edges
    power = float((steps * steps).mean())
    apart = float((steps[2:] * steps[:-2]).mean()) - float((steps[1:] * steps[:-1]).mean())
    return apart > 2.0 * BEGINS * power


def demodulated(counts: Array) -> Array:
    """Readings of the mean light of each one and the one before, same shape; whole counts no more."""
    light = FULL_SCALE / np.maximum(counts, 1.0) - 1.0
    before = np.concatenate([light[:1], light[:-1]])
    before[0] = light[1] if len(light) > 1 else light[0]
    return np.asarray(FULL_SCALE / (1.0 + 0.5 * (light + before)))


class FlickerWatch:
    """The same while driving: `update` with every reading; flickers: whether to go by the mean of two."""

    __slots__ = ("_apart", "_counts", "_older", "_power", "_step", "flickers")

    def __init__(self, *, flickers: bool = False) -> None:
        self.flickers = flickers
        self._counts: float | None = None
        self._step = self._older = 0.0
        self._power = 9.0
        self._apart = 2.0 * self._power if flickers else 0.0

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
        apart = self._apart = self._apart + FORGET * (step * (self._older - self._step) - self._apart)
        self._older, self._step = self._step, step
        if self.flickers:
            self.flickers = apart > 2.0 * ENDS * power
        elif apart > 2.0 * BEGINS * power:
            self.flickers = True
