"""Position counters: 32-bit words that wrap, tear and restart become 64-bit positions that do not."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.core.readings import MOTOR_PORTS

Counts = tuple[int, int, int, int]
Bemf = tuple[float, float, float, float]


def are_near_zero(words: Sequence[int], limit: float) -> bool:
    """Whether all counters lie within `limit` of 0, as after a start."""
    return max(words) <= limit and min(words) >= -limit


class Counters:
    """Four counters, unwrapped.

    fastest: counts a second that no motor exceeds. A difference beyond twice what that allows is a jump.
    """

    def __init__(self, fastest: float) -> None:
        self._limit_rate = 2.0 * fastest
        self._last: Sequence[int] = (0,) * MOTOR_PORTS
        self.totals = [0] * MOTOR_PORTS

    def differences(self, raw: Sequence[int]) -> Counts:
        """How far each counter has moved since the last accepted words; modular, so a wrap is no jump."""
        a, b, c, d = (
            ((new - old + 0x8000_0000) & 0xFFFF_FFFF) - 0x8000_0000
            for new, old in zip(raw, self._last, strict=True)
        )
        return a, b, c, d

    def are_plausible(self, differences: Counts, seconds: float) -> bool:
        """Whether motors can have moved that far in this time (at least one cycle of the firmware)."""
        limit = self._limit_rate * max(seconds, 0.006)
        return -limit <= min(differences) and max(differences) <= limit

    def accept(self, raw: Sequence[int], differences: Counts) -> None:
        """Count on by these differences."""
        self._last = raw
        totals = self.totals
        for port, difference in enumerate(differences):
            totals[port] += difference

    def continue_from(self, raw: Sequence[int]) -> None:
        """Take new words as the continuation of the old positions: the counter jumped, not the robot."""
        self._last = raw
