"""Classification of the lines of a recording by their times: forward, backward, or after an outlier."""

from __future__ import annotations

import math
from enum import Enum

from raccoon.trace.file_hints import clock_reset_reason


class TimeStep(Enum):
    """How the time of a line continues those before it."""

    FORWARD = "forward"
    BACKWARD = "backward"
    """The line must be left out."""
    PAST_OUTLIER = "past outlier"
    """This line and the one before it continue from before the last accepted line, which was an outlier far
    ahead and must be left out. This occurs if two numbers of a serial line ran together; otherwise all lines
    after it would go back."""


class TimeOrder:
    """Classifies the times of lines one by one.

    backward_count: number of lines that went back. first_reset_reason: the probable reason of the first of
    them. outlier_time: time of the outlier, if the last step is PAST_OUTLIER.
    """

    def __init__(self) -> None:
        self.backward_count = 0
        self.first_reset_reason = ""
        self.outlier_time = math.nan
        self._before, self._last, self._doubted = -math.inf, -math.inf, math.inf

    def classify(self, time: float) -> TimeStep:
        """The step of the next line at `time`. NaN is BACKWARD and is not counted."""
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
