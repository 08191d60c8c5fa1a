"""Lines of a recording by their times: which go on, which go back, and which was far ahead of all others."""

from __future__ import annotations

import math
from enum import Enum

from raccoon.trace.file_hints import clock_reset_reason


class TimeStep(Enum):
    """How a line's time goes on from those before it."""

    FORWARD = "forward"
    BACKWARD = "backward"
    """It is to be left out."""
    PAST_OUTLIER = "past outlier"
    """It goes on, as the line before it did, from where all was before the last one that went on: that one is
    to be left out. Where two numbers of a serial line ran together, all that follows would else be back."""


class TimeOrder:
    """Classifies the times of lines one by one.

    backward_count: how many went back. first_reset_reason: what the first of them seems to be. outlier_time:
    of the line that was far ahead, where the last step is PAST_OUTLIER."""

    def __init__(self) -> None:
        self.backward_count = 0
        self.first_reset_reason = ""
        self.outlier_time = math.nan
        self._before, self._last, self._doubted = -math.inf, -math.inf, math.inf

    def classify(self, time: float) -> TimeStep:
        """The step in time to the next line. NaN goes back and is not counted."""
        if time >= self._last:
            self._before, self._last, self._doubted = self._last, time, math.inf
            return TimeStep.FORWARD
        doubted, self._doubted = self._doubted, time if time >= self._before else math.inf
        if time >= doubted:
            self.outlier_time, self._last, self._doubted = self._last, time, math.inf
            return TimeStep.PAST_OUTLIER
        if time < self._last:
            self.backward_count += 1
            self.first_reset_reason = self.first_reset_reason or clock_reset_reason(self._last, time)
        return TimeStep.BACKWARD
