"""The rate at which RaccoonOS updates its counters."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.hal.wombat.firmware.counters import Counts


class CounterRate:
    """Estimate of the update rate of a firmware that sums back-EMF samples and sends both back-EMF and
    counter (RaccoonOS 17)."""

    MOVING = 100.0
    """Back-EMF in counts from which a motor is used."""

    def __init__(self) -> None:
        self._counts = 0.0
        self._counts_seconds = 0.0
        self._seconds = 0.0

    def update(self, differences: Counts, bemf: Sequence[float], seconds: float) -> None:
        """Update with one cycle: differences of the counters, back-EMF in counts, and the time since the last
        one, s."""
        for difference, value in zip(differences, bemf, strict=True):
            if abs(value) > self.MOVING:
                self._counts += abs(difference)
                self._counts_seconds += abs(value) * seconds
                self._seconds += seconds

    @property
    def rate_hz(self) -> float | None:
        """Measured updates a second, None before half a second of motion."""
        return self._counts / self._counts_seconds if self._seconds >= 0.5 else None
