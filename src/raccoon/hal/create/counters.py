"""Conversion of the base's 16-bit encoder words into positions that do not wrap; jumps are reported."""

from __future__ import annotations

from raccoon.core.readings import Fault

TICKS_PER_SECOND = 0.5 / (0.036 * 2.0 * 3.141592653589793 / 508.8)
"""Ticks a second at the base's top speed: 0.5 m/s on wheels of 72 mm."""
_MARGIN = 1.5
"""Plausible speed over the top speed."""
_SHORTEST_ELAPSED = 0.06
"""Shortest time between frames, s, in the plausibility limit: the serial adapter delivers frames in bursts,
closer together than they were sent."""
_NEAR_ZERO = 200
"""Ticks within which a counter may have restarted."""
_GAP = 0.5
"""s without a frame after which the base may have been switched off and on."""


class WheelCounter:
    """Unwraps the counter of one wheel. `position` is in ticks and starts at 0."""

    def __init__(self) -> None:
        self.position = 0
        self._word: int | None = None

    def update(self, word: int, elapsed: float) -> Fault | None:
        """Update with the counter's next word, `elapsed` s after the last.

        A difference that the wheel cannot have made is not added; the fault is returned: RESET if the counter
        restarted (after a gap any count near 0 is taken for that), POSITION_JUMP otherwise. None if all is
        well.
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
