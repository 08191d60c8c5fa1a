"""Readings of a sensor that stands: which of them say something, and what it was put on.

A robot that is lifted and put down again crosses no edge, nor does one under which somebody shifts the
paper. Its sensors may read anything meanwhile, which looks like a change of light, and then a surface as
before. Light that changes ends at any level, and hardly at just this one.
"""

from __future__ import annotations

from raccoon.estimate.tophat.hypotheses import Belief
from raccoon.estimate.tophat.levels import GATE_SDS, Levels
from raccoon.model.reflectance import FULL_SCALE

STANDING_WAY_M = 2e-5  # m per reading below which a sensor stands
PLACED_READINGS = 20  # readings in a row of a surface after which the sensor is on it
DARKER_SHARE = 0.8  # share of white's light in darkness below which a surface is no white in any light


class RestingPlace:
    """What a sensor at rest stands on. before: the levels before something changed, None if nothing has."""

    __slots__ = (
        "_black",
        "_is_black_certain",
        "_last",
        "_readings",
        "_sd_black",
        "_sd_white",
        "_white",
        "before",
    )

    def __init__(self) -> None:
        self.before: Belief | None = None
        self._white = self._black = self._sd_white = self._sd_black = 0.0
        self._is_black_certain = False
        self._readings = 0  # of a surface of before, in a row
        self._last = -1e9  # last reading with information

    def is_informative(self, counts: float, way: float, levels: Levels) -> bool:
        """Whether a reading that no surface explains holds information: another one of a sensor at rest does
        not. way: m since the one before. levels: how readings of the surfaces scatter.

        A sensor half on a line reads a value of neither surface for as long as it stands there.
        """
        apart, variance = counts - self._last, levels.difference_variance
        if way < STANDING_WAY_M and apart * apart < GATE_SDS * GATE_SDS * variance:
            return False
        self._last = counts
        return True

    def begin(self, way: float, before: Belief, levels: Levels, least_light: float) -> None:
        """Something changes. way: m since the reading before. before: levels until then. levels: their
        standard deviations. least_light: over white, in darkness."""
        if way >= STANDING_WAY_M or self.before is not None:
            return
        self.before, self._readings = before, 0
        self._white, self._black = FULL_SCALE / (1.0 + before.light), FULL_SCALE / (1.0 + before.dark)
        self._sd_white, self._sd_black = levels.sd_white, levels.sd_black
        self._is_black_certain = before.dark < DARKER_SHARE * least_light

    def find_surface(self, counts: float, way: float) -> Belief | None:
        """The levels from before the change, once the sensor has been put on one of their surfaces: on white,
        or on black where no white is as dark."""
        if way >= STANDING_WAY_M:
            self.before = None
        on_white = abs(counts - self._white) < GATE_SDS * self._sd_white
        on_black = self._is_black_certain and abs(counts - self._black) < GATE_SDS * self._sd_black
        self._readings = self._readings + 1 if on_white or on_black else 0
        if self._readings < PLACED_READINGS:
            return None
        found, self.before = self.before, None
        return found
