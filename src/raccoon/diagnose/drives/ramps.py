"""A limit of how fast a command may change, between what a program asks for and what its motors get."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Ramp:
    """rate: duty a second by which what motors get changes at most. soft: whether only in what drives them
    more, as a driver that starts softly; what drives them less acts at once."""

    rate: float
    soft: bool = False

    def given(self, time: Array, duty: Array) -> Array:
        """What motors get of commands (n, wheels)."""
        most = (self.rate * np.diff(time, prepend=time[0])).tolist()
        return np.stack([self._followed(each.tolist(), most) for each in duty.T], axis=1)

    def _followed(self, duty: list[float], most: list[float]) -> Array:
        now, found = duty[0], []
        for asked, by in zip(duty, most, strict=True):
            less = more = now
            if self.soft:
                same = now if now * asked > 0.0 else 0.0
                less, more = min(same, 0.0), max(same, 0.0)
            now = min(max(asked, less - by), more + by)
            found.append(now)
        return np.array(found)
