"""All tophats of a robot, which share one light."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.estimate.tophat.classifier import Tophat, TophatReading
from raccoon.estimate.tophat.tracker import LightTracker


class TophatGroup:
    """All tophats of a robot, which share one light: a change is believed sooner if several sensors see
    it."""

    def __init__(self, tophats: Sequence[Tophat]) -> None:
        self.tophats = tuple(tophats)

    def update(
        self, time: float, counts: Sequence[float | None], ways: Sequence[float | None] | None = None
    ) -> tuple[TophatReading, ...]:
        """Classify one reading for each sensor, in the order of `tophats`; ways: see `Tophat.update`.

        Raises ValueError for another number of readings.
        """
        tophats = self.tophats
        if ways is None:
            ways = [None] * len(tophats)
        lost = [each.lost for each in tophats]
        count, alone = sum(lost), len(tophats) == 1
        for each, reading, own, way in zip(tophats, counts, lost, ways, strict=True):
            each.take(time, reading, None if alone else count > own, way)
        LightTracker.run_banks([each.levels for each in tophats])
        return tuple(each.classify() for each in tophats)
