"""The readings of simulated tophats over a world."""

from __future__ import annotations

import math

from raccoon.core.config import TophatConfig
from raccoon.model.reflectance import Optics, fit, spot_radius
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.world.table import World

SENSOR_GENERATION = "new"


class Tophat:
    """One simulated tophat with its effects.

    Its reading is factor * counts + offset, with the counts of the reflectance model at the sensor's height.
    """

    def __init__(self, config: TophatConfig, parameters: Parameters) -> None:
        where = str(config.analog)
        self.port = config.analog
        self.noise_sd = parameters.value("tophat.noise", "sd", where)
        self._forward, self._left = config.forward, config.left
        height = parameters.value("tophat.height", "height", where)
        self._optics: Optics = fit(SENSOR_GENERATION).at(height)
        self._spot = spot_radius(height)
        self._factor = parameters.value("tophat.gain", "factor", where)
        self._offset = parameters.value("tophat.ambient_light", "offset", where)
        self._floor = (self._counts(0.0, 0.0), self._counts(1.0, 0.0))
        # Where the distance to a line was last computed, and how far the sensor may move from there before
        # its spot can reach an edge.
        self._x = self._y = 0.0
        self._slack = -1.0
        self._black = False

    def read(
        self, world: World, x: float, y: float, cosine: float, sine: float, time: float
    ) -> tuple[float, bool]:
        """The reading, counts (not rounded, not limited), and whether the floor under the sensor is black,
        for a robot at (x, y), m, with this cosine and sine of its heading."""
        at_x = x + self._forward * cosine - self._left * sine
        at_y = y + self._forward * sine + self._left * cosine
        # The distance to an edge changes by no more than the sensor moves, so far from edges the last result
        # still holds.
        if math.hypot(at_x - self._x, at_y - self._y) < self._slack:
            dark = 1.0 if self._black else 0.0
        else:
            distance, width = world.nearest_line(at_x, at_y)
            # The part beyond the line's near edge, less that beyond its far edge: a line may be narrower than
            # the spot.
            dark = darkness(distance, self._spot) - darkness(distance + width, self._spot)
            self._x, self._y = at_x, at_y
            self._slack, self._black = abs(distance) - self._spot, distance < 0.0
        if not world.lights and dark in (0.0, 1.0):
            return self._floor[int(dark)], self._black
        return self._counts(dark, world.ambient(at_x, at_y, time)), self._black

    def over(self, black: bool, ambient: float = 0.0) -> float:
        """Counts over black or white paper. ambient: level of light, 0 indoors, 1 direct sun."""
        return self._counts(1.0 if black else 0.0, ambient)

    def _counts(self, dark: float, ambient: float) -> float:
        return self._factor * self._optics.counts(dark, ambient) + self._offset


def darkness(distance: float, radius: float) -> float:
    """Share, 0..1, of a round spot that lies beyond a straight edge. distance: from the spot's centre to the
    edge, m, negative if the centre is beyond it. radius: of the spot, m."""
    t = distance / radius
    if t >= 1.0:
        return 0.0
    if t <= -1.0:
        return 1.0
    return (math.acos(t) - t * math.sqrt(1.0 - t * t)) / math.pi
