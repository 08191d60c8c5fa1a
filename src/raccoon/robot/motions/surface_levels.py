"""What a tophat reads over floor and line while it is moved over both, to learn them in another light."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raccoon.robot.parts.tophats import TophatSensor

SURFACE_READINGS = 4
"""Consecutive readings whose mean is a surface's reading."""


class SurfaceLevels:
    """The lowest and the highest mean that a sensor read: floor and line, if it went over both."""

    def __init__(self, sensor: TophatSensor) -> None:
        self._sensor = sensor
        self._last_counts: deque[float] = deque(maxlen=SURFACE_READINGS)
        self._white, self._black = math.inf, -math.inf

    def read(self) -> None:
        """Take the reading of this cycle."""
        last, counts = self._last_counts, self._sensor.counts
        if counts is not None and self._sensor.sees:
            last.append(counts)
        if len(last) == SURFACE_READINGS:
            mean = sum(last) / SURFACE_READINGS
            self._white, self._black = min(self._white, mean), max(self._black, mean)

    def learn(self) -> bool:
        """Let the sensor take them over; returns whether it did, which it does if they are two surfaces."""
        return self._sensor.relearn(self._white, self._black)
