"""Changes between white and black that are too abrupt for an edge, as of a sensor whose wire breaks.

Behind a filter, such as that of the stock firmware, a broken wire takes a dozen readings to the end of the
converter's range, and passes the other surface on its way.
"""

from __future__ import annotations

import math

from raccoon.model.reflectance import FULL_SCALE, spot_radius

CLEAR_COVERAGE = 0.15
CLEAR_BLACK = 1.0 - CLEAR_COVERAGE
"""Shares of the spot on black up to which a reading is white, and from which it is black."""
LEAST_WAY_M = 0.7 * 0.5 * math.pi * spot_radius(0.005)
"""m driven for each unit of coverage, at the least: pi / 2 radii while the middle of the spot comes over an
edge. The spot is that of the lowest sensors, and may be narrower by 30 %: its width is an assumption, and a
calibration in the sun hardly shows the height."""
SETTLED_SHARE = 0.2
"""Change of a reading up to which it has settled, as a share of the way to the end of the range. Of a reading
that a filter brings there it is half or more."""
MAX_HELD_READINGS = 15
"""Readings after which an abrupt change is believed: the stock filter comes to the end of the range in
these."""


class JumpWatch:
    """Judges the changes of one sensor by the distance that it moves meanwhile.

    is_held: whether the answer is that of before an abrupt change, until it is known what that is.
    """

    __slots__ = ("_change", "_counts", "_way_from_black", "_way_from_white", "is_held")

    def __init__(self) -> None:
        self._way_from_white = self._way_from_black = math.inf  # m since the sensor was on one surface
        self._counts = self._change = 0.0  # the last reading, and its difference to the one before
        self.is_held = False

    def skip(self, way: float | None) -> None:
        """A tick without a reading. way: m, None if unknown."""
        way = math.inf if way is None else way
        self._way_from_white += way
        self._way_from_black += way

    def update(self, counts: float, coverage: float, way: float | None, *, sure: bool) -> None:
        """Take a reading. way: m since the tick before, None if unknown. sure: whether the light is known."""
        way = math.inf if way is None else way
        self._way_from_white = 0.0 if sure and coverage <= CLEAR_COVERAGE else self._way_from_white + way
        self._way_from_black = 0.0 if sure and coverage >= CLEAR_BLACK else self._way_from_black + way
        self._change, self._counts = counts - self._counts, counts

    def holds(self, coverage: float, readings: int, *, to_black: bool) -> bool:
        """Whether the present reading may be on its way through the other surface, rather than on it.

        readings: number of readings in a row on the other side. An abrupt change that settles there is
        believed: somebody put the robot down, or switched a lamp on.
        """
        if not self.is_held:
            way = self._way_from_white if to_black else self._way_from_black
            changed = (coverage if to_black else 1.0 - coverage) - CLEAR_COVERAGE
            self.is_held = way < LEAST_WAY_M * changed
        rest = FULL_SCALE - self._counts if self._change > 0.0 else self._counts
        if abs(self._change) <= SETTLED_SHARE * rest or readings > MAX_HELD_READINGS:
            self.is_held = False
        return self.is_held

    def release(self) -> None:
        """The sensor reads its former surface again."""
        self.is_held = False
