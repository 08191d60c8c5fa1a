"""Detection of motors whose back-EMF repeats itself although they turn."""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.core.readings import BEMF_FROZEN_SECONDS, MOTOR_PORTS


class RepeatWatch:
    """Detects back-EMF from a converter that has stopped: noise changes the words of a working one.

    Words near 0 may repeat: filters suppress the noise, and a dead zone hides more. most: the largest
    back-EMF that the firmware measures, counts; beyond it the firmware holds its last word (None: no such
    limit). frozen: for each motor, whether its back-EMF repeats itself.
    """

    TURNING = 64.0
    """Back-EMF in counts from which words must not repeat."""
    NEAR = 0.85
    """Upper limit for that as a share of `most`: from here a motor may exceed `most` between two
    conversions."""
    PAUSE = 0.1
    """s between two words above which their equality means nothing."""

    def __init__(self, most: float | None = None) -> None:
        self._max_repeats = math.inf if most is None else self.NEAR * most
        self._last = [0.0] * MOTOR_PORTS
        self._repeated = [0.0] * MOTOR_PORTS
        self._time = 0.0
        self.frozen = (False,) * MOTOR_PORTS

    def update(self, bemf: Sequence[float], time: float) -> None:
        """Update with new back-EMF words, in counts as the controller reports them; time in s."""
        dt, self._time = time - self._time, time
        if dt > self.PAUSE:
            dt = 0.0
        for port, value in enumerate(bemf):
            if value != self._last[port] or not self.TURNING <= abs(value) < self._max_repeats:
                self._last[port], self._repeated[port] = value, 0.0
            else:
                self._repeated[port] += dt
        a, b, c, d = (seconds > BEMF_FROZEN_SECONDS for seconds in self._repeated)
        self.frozen = a, b, c, d
