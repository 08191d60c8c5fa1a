"""Lines of a recording by their times: which go on, which go back, and which was far ahead of all others."""

from __future__ import annotations

import math
from enum import Enum

from raccoon.trace.mistaken import began_anew


class Step(Enum):
    """How a line's time goes on from those before it."""

    ON = "on"
    BACK = "back"
    """It is to be left out."""
    PAST = "past"
    """It goes on, as the line before it did, from where all was before the last one that went on: that one is
    to be left out. Where two numbers of a serial line ran together, all that follows would else be back."""


class Advance:
    """Take the times of lines one by one.

    backward: how many went back. anew: what the first of them seems to be. wild: time of the line that was
    far ahead, where the last step is PAST.
    """

    def __init__(self) -> None:
        self.backward = 0
        self.anew = ""
        self.wild = math.nan
        self._before, self._last, self._doubted = -math.inf, -math.inf, math.inf

    def take(self, time: float) -> Step:
        """The step to the next line. NaN goes back and is not counted."""
        if time >= self._last:
            self._before, self._last, self._doubted = self._last, time, math.inf
            return Step.ON
        doubted, self._doubted = self._doubted, time if time >= self._before else math.inf
        if time >= doubted:
            self.wild, self._last, self._doubted = self._last, time, math.inf
            return Step.PAST
        if time < self._last:
            self.backward += 1
            self.anew = self.anew or began_anew(self._last, time)
        return Step.BACK
