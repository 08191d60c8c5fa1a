"""From a 16-bit encoder word to a position that does not wrap, and that does not jump unnoticed."""

from __future__ import annotations

from raccoon.core.readings import Fault

TICKS_PER_SECOND = 0.5 / (0.036 * 2.0 * 3.141592653589793 / 508.8)
"""Ticks a second at the base's top speed: 0.5 m/s on wheels of 72 mm."""
_MARGIN = 1.5
_SHORTEST_ELAPSED = 0.06
"""s; frames bunch up in the serial adapter, so two of them may arrive closer together than they were made."""
_NEAR_ZERO = 200
_GAP = 0.5
"""s without a frame after which the base may have been switched off and on."""


class WheelCounter:
    """Sums modular differences of the base's counter. `position` is in ticks and starts at 0."""

    def __init__(self) -> None:
        self.position = 0
        self._word: int | None = None

    def update(self, word: int, elapsed: float) -> Fault | None:
        """Take the counter's next word, `elapsed` s after the last.

        A difference the wheel cannot have made is left out and named: RESET where the counter started again
        (after a gap any count near 0 is taken for that), POSITION_JUMP otherwise.
        """
        last, self._word = self._word, word
        if last is None:
            return None
        difference = (word - last + 0x8000) % 0x10000 - 0x8000
        limit = _MARGIN * TICKS_PER_SECOND * max(elapsed, _SHORTEST_ELAPSED)
        restarted = _near_zero(word) and not _near_zero(last)
        if abs(difference) > limit or (restarted and elapsed > _GAP):
            return Fault.RESET if restarted else Fault.POSITION_JUMP
        self.position += difference
        return None


def _near_zero(word: int) -> bool:
    return min(word, 0x10000 - word) < _NEAR_ZERO
