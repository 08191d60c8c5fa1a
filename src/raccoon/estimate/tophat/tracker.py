"""Where white and black stand now, in a light that changes.

What a surface explains is learnt by its filter (`levels`). A reading that neither explains is one of three:

* brighter than white or darker than black: the light changed, and the levels jump there.
* between both for long, and steady: the light changed too, unless half the spot lies on a line. Which surface
  it is follows from what was seen before, from how quickly it came (an edge takes a few readings, light takes
  more) and from the light that can be lost: no more than there was.
* in passing: an edge, a spike. Nothing is learnt.

Where other sensors of the robot are at a loss at the same time, the second case is believed sooner; where
they are not, later: light changes reach all of them.
"""

from __future__ import annotations

import math

from raccoon.core.readings import Status
from raccoon.estimate.tophat.calibration import LEAST_SD, Surface
from raccoon.estimate.tophat.levels import Levels, light_of_counts, light_per_count

GATE, NARROW_GATE = 4.5, 3.0  # standard deviations within which a reading belongs to a surface
LEVEL = 2.0  # standard deviations between readings that are learnt from; on an edge they differ by more
STEADY = 3.0  # the same for readings that are not explained
OUTSIDE_READINGS, OUTSIDE_AT_MOST = 2, 12  # steady beyond both surfaces, and beyond them at all
BETWEEN_READINGS = {True: 8, None: 12, False: 60}  # steady between both; by whether other sensors are lost
UNSURE_READINGS = 40  # unexplained for so long: say so
EDGE_READINGS = 10  # from one level to the next; light takes longer
SURFACES_APART = 1.4  # light of white over light of black: 1.7 in direct sun, 10 and more indoors
NEW = 4  # readings after which a surface has been seen
MOMENT = 60  # readings within which light hardly changes unseen
NOTHING = (-1e9, -1e9, -1e9)


class LightTracker(Levels):
    """Levels that follow the light: `update` with every reading, then see `Levels`.

    jumps: how often the light was found to have changed at once. stray: readings in a row that neither
    surface explains; status is `uncertain` where that lasts.
    """

    __slots__ = ("_calm", "_lasted", "_level", "_on_black", "_recent", "_since_white", "jumps", "stray")

    def __init__(self, white: Surface, black: Surface) -> None:
        super().__init__(white, black)
        self._on_black: bool | None = None
        self._level = 0.0  # where unexplained readings stand
        self._recent = NOTHING  # the last readings on one surface, oldest first
        self._since_white = self._lasted = 0  # readings since white was learnt; learnt of this surface
        self.stray = self._calm = self.jumps = 0

    def update(self, counts: float, others_lost: bool | None = None) -> None:
        """Learn from a reading. others_lost: whether other sensors are at a loss; None: there are none."""
        on_black = counts >= self.threshold
        miss = counts - (self.black if on_black else self.white)
        spread = self.sd_black if on_black else self.sd_white
        gate = GATE
        if self.stray > EDGE_READINGS and on_black is not self._on_black:
            gate = NARROW_GATE  # no edge takes so long: another surface must fit well
        if not -gate * spread <= miss <= gate * spread:
            self._recent = NOTHING
            self._explain(counts, others_lost)
            return
        self.stray = 0
        oldest, older, old = self._recent
        self._recent = (older, old, counts)
        change = counts - oldest
        noise = self._dark_noise if on_black else self._light_noise
        if change * change <= LEVEL * LEVEL * (noise + LEAST_SD):
            self._lasted = self._lasted + 1 if on_black is self._on_black else 0
            self._on_black = on_black
            self._since_white = self._since_white + 1 if on_black else 0
            self._learn(counts, on_black, miss, noise)
            self._refresh()

    def _explain(self, counts: float, others_lost: bool | None) -> None:
        """A reading that belongs to no surface: wait until it is clear what it says."""
        step = counts - self._level
        variance = self._light_noise + self._dark_noise
        steady = self.stray > 0 and step * step <= STEADY * STEADY * variance
        self._level = self._level + 0.3 * step if steady else counts
        self._calm = self._calm + 1 if steady else 0
        self.stray += 1
        self._since_white += 1
        if self.stray >= UNSURE_READINGS:
            self.status = Status.UNCERTAIN
        outside = self._calm >= OUTSIDE_READINGS or self.stray >= OUTSIDE_AT_MOST
        if counts < self.white:
            if outside:
                self._decide_below()
        elif outside if counts > self.black else self._calm >= BETWEEN_READINGS[others_lost]:
            self._decide_between()

    def _decide_below(self) -> None:
        """Brighter than white. Quickly, and from a white that is new: that was black, and this is an edge."""
        new = NEW <= self._lasted < MOMENT and not self._on_black and self.jumps > 0
        if new and self._is_edge(light_of_counts(self._level), self.light):
            self._dark_noise = self._light_noise
            self.dark, self._dark_var = self.light, self._light_var
            self._jump_on_white(black_moves=False)
        else:
            self._jump_on_white()

    def _decide_between(self) -> None:
        """Darker than white, and not the black that was expected.

        White in less light reads like black in more. It is what it was, if there was as much light to lose;
        but a quick rise from a black that lasted is an edge: that was white.
        """
        level = light_of_counts(self._level)
        if level * level * level > self.light * self.light * self.dark:
            self._jump_on_white()  # much nearer to white: it moved while black was seen
        elif self._on_black and self._lasted > MOMENT and self._level > self.black:
            if self.dark > self._floor and self._is_edge(self.dark, level):
                self.light, self._light_var, self._light_noise = self.dark, self._dark_var, self._dark_noise
                self._since_white = 0
            self._jump_on_black()
        elif self._on_black or (level < self._floor and self._level > self.black):
            self._jump_on_black()
        elif level >= self._floor:
            self._jump_on_white()
        else:
            self.status = Status.UNCERTAIN  # half on a line, most likely; there is nothing to learn from that

    def _is_edge(self, more: float, less: float) -> bool:
        """Whether the way from one light to the other was as short, and as far, as between two surfaces."""
        return self.stray - self._calm <= EDGE_READINGS and more > SURFACES_APART * less

    def _jump_on_white(self, *, black_moves: bool = True) -> None:
        """White is where the readings are, and black where the changed light puts it."""
        light = light_of_counts(self._level)
        if black_moves:
            self.dark += self._share * (light - self.light)
            # Black has no more than its share of the ambient light that white can have.
            self.dark = min(self.dark, 1.3 * self._share * max(light - self._own, 0.0) + 0.06 * self._own)
        noise = (light_per_count(self._level) * math.sqrt(self._light_noise)) ** 2
        self._light_var, self._cross, self._dark_var = noise, self._share * noise, self._share**2 * noise
        self.light = light
        self._settle(on_black=False)

    def _jump_on_black(self) -> None:
        """The same with black seen. White seen a moment ago stands: then black was not known, no light
        changed.

        White cannot send back less than its own light.
        """
        dark = light_of_counts(self._level)
        noise = (light_per_count(self._level) * math.sqrt(self._dark_noise)) ** 2
        self._dark_var, self._cross = noise, 0.0
        if self._since_white > MOMENT:
            self.light = max(self.light + (dark - self.dark) / self._share, self._floor + dark, 1.1 * dark)
            self._cross, self._light_var = noise / self._share, noise / self._share**2
        self.dark = dark
        self._settle(on_black=True)

    def _settle(self, *, on_black: bool) -> None:
        self._lasted = 0
        self._on_black = on_black
        self._refresh()
        if on_black:
            self._light_anchor = self.light
        else:
            self._dark_anchor = self.dark
        self.stray = 0
        self.jumps += 1
