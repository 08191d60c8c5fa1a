"""The recent readings of a sensor, which a bank of hypotheses processes when something changed."""

from __future__ import annotations

STEP_M, MAX_STEP_READINGS = 8e-4, 8  # m of distance for one entry, and most readings in it
MIN_ENTRIES = 32  # least number of entries that a bank processes


class ReadingLog:
    """Readings as means over `STEP_M` of distance, each with its distance (m).

    A slow spot sees the same floor for many readings, and they hold no more information than one. entries:
    counts and distance of each. taken: number of entries that the bank has processed.
    """

    __slots__ = ("_counts", "_readings", "_way", "entries", "taken")

    def __init__(self) -> None:
        self.entries: list[tuple[float, float]] = []
        self.taken = self._readings = 0
        self._counts = self._way = 0.0  # sums of the readings that make no entry yet

    def add(self, counts: float, way: float) -> None:
        """Keep a reading."""
        readings = self._readings = self._readings + 1
        self._counts += counts
        way = self._way = self._way + way
        if way >= STEP_M or readings >= MAX_STEP_READINGS:
            self.entries.append((self._counts / readings, way))
            self._counts = self._way = 0.0
            self._readings = 0

    def take(self) -> tuple[float, float]:
        """The next entry for the bank."""
        entry = self.entries[self.taken]
        self.taken += 1
        return entry

    def trim(self) -> bool:
        """Forget all but the last `MIN_ENTRIES` entries if they are twice as many. Tells whether it did."""
        if len(self.entries) < 2 * MIN_ENTRIES:
            return False
        del self.entries[:-MIN_ENTRIES]
        return True

    def clear(self) -> None:
        """Forget all entries."""
        self.entries.clear()
        self.taken = 0

    def restart(self) -> None:
        """Forget all readings."""
        self.clear()
        self._counts = self._way = 0.0
        self._readings = 0
