"""Unwrapping of position counters: from 32-bit words that wrap, tear and restart to 64-bit positions that do
not."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.core.readings import MOTOR_PORTS

Counts = tuple[int, int, int, int]
Bemf = tuple[float, float, float, float]


def are_near_zero(words: Sequence[int], limit: float) -> bool:
    """Whether all counters are within `limit` counts of 0, as after a start."""
    return max(words) <= limit and min(words) >= -limit


class Counters:
    """Four unwrapped counters; `totals` are their positions in counts.

    fastest: counts a second that no motor exceeds. A difference beyond twice that rate is a jump.
    """

    def __init__(self, fastest: float) -> None:
        self._limit_rate = 2.0 * fastest
        self._last: Sequence[int] = (0,) * MOTOR_PORTS
        self.totals = [0] * MOTOR_PORTS

    def differences(self, raw: Sequence[int]) -> Counts:
        """Difference of each counter from the last accepted words; modular, so a wrap is no jump."""
        a, b, c, d = (
            ((new - old + 0x8000_0000) & 0xFFFF_FFFF) - 0x8000_0000
            for new, old in zip(raw, self._last, strict=True)
        )
        return a, b, c, d

    def are_plausible(self, differences: Counts, seconds: float) -> bool:
        """Whether motors can have moved that far in this time, s (taken as at least one cycle of the
        firmware)."""
        limit = self._limit_rate * max(seconds, 0.006)
        return -limit <= min(differences) and max(differences) <= limit

    def accept(self, raw: Sequence[int], differences: Counts) -> None:
        """Accept the words `raw` and add the differences to the positions."""
        self._last = raw
        totals = self.totals
        for port, difference in enumerate(differences):
            totals[port] += difference

    def continue_from(self, raw: Sequence[int]) -> None:
        """Accept the words `raw` without a change of the positions: the counters jumped, not the robot."""
        self._last = raw
