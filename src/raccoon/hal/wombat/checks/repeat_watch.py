"""Motors whose back-EMF repeats itself although they turn."""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.core.readings import BEMF_FROZEN_SECONDS, MOTOR_PORTS


class RepeatWatch:
    """Whether a motor's back-EMF comes from a converter that has stopped: noise changes every one that works.

    Near 0 words may repeat themselves: filters swallow the noise, and a dead zone hides more.
    most: counts beyond which a firmware measures nothing, and holds the last word by itself (None: there is
    no such end). frozen: of each motor, whether it repeats itself.
    """

    TURNING = 64.0
    """Counts."""
    NEAR = 0.85
    """Of the most that a firmware measures: a motor may go beyond it from here between two conversions."""
    PAUSE = 0.1
    """s between two words, of which nobody knows what lay between."""

    def __init__(self, most: float | None = None) -> None:
        self._max_repeats = math.inf if most is None else self.NEAR * most
        self._last = [0.0] * MOTOR_PORTS
        self._repeated = [0.0] * MOTOR_PORTS
        self._time = 0.0
        self.frozen = (False,) * MOTOR_PORTS

    def update(self, bemf: Sequence[float], time: float) -> None:
        """Take new words, in counts as the controller reports them."""
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
