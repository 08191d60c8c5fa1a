"""Where white and black stand now, in a light that changes.

What a surface explains is learnt by its filter (`levels`). Readings that neither explains are an edge being
crossed, as long as the way driven meanwhile fits one. Where it does not, or where they last, a bank of
hypotheses (`hypotheses`) goes through everything that was read lately and says whether the light or the
surface changed. It stays in charge until one story is sure; until then the status is `uncertain`.
"""

from __future__ import annotations

from raccoon.core.readings import ANALOG_BOTTOM, Status
from raccoon.estimate.tophat.calibration import LEAST_SD, Surface
from raccoon.estimate.tophat.hypotheses import Belief, Hypotheses, Sensor, pattern_of, usual_spot
from raccoon.estimate.tophat.levels import CONVERTER_NOISE, FLOOR, GATE, Levels, longest
from raccoon.estimate.tophat.sensor import DARKEST, explanations

LEVEL = 2.0  # standard deviations between readings that are learnt from; on an edge they differ by more
USUAL_WAY = 0.0012  # m a reading, where nobody says: 0.24 m/s at 200 Hz
STEP, MOST_IN_ONE = 8e-4, 8  # m of way for one reading of the bank, and readings in it at the most
STILL = 2e-5  # m a reading, below which a sensor stands
USUAL_HEIGHT = 0.012  # m, of a sensor that is none of the two
MOST_STRAY, MOST_OUTSIDE = 120, 6  # readings that nothing explains, and those beyond both surfaces
OUTSIDE_AT_START = 2  # of those, where a robot was put down
REMEMBERED = 32  # readings, at the least, that the bank goes through
CATCH_UP = 3  # of them in one tick
LIKELIER, BELIEVED, SURE = 0.6, 0.9, 0.99  # probabilities: to follow in calm, always, and to end the doubt
STEADY = 0.95  # probability from which it is calm
CALM_READINGS, STEADY_READINGS = 4, 8
WIDEST = 0.15  # m of black, from which it may as well be white in less light
LEAN_SHARE = 0.1  # of a reading in the mean of what the levels miss by lately
LEAN_READINGS = 15  # on one surface before that is asked; a line is shorter
MOST_LEAN = 1.5  # standard deviations of that from which the light runs ahead of the levels
NOTHING = (-1e9, -1e9, -1e9)


class LightTracker(Levels):
    """Levels that follow the light: `update` with every reading, then see `Levels`.

    jumps: how often a change of light was noticed so late that readings had been taken for the other surface.
    stray: readings in a row that neither surface explains. in_doubt: whether the bank is at work. unread: m
    that the sensor went since the last reading, where there was none; the next one is of that way, too.
    """

    __slots__ = (
        "_bank",
        "_black_way",
        "_calm",
        "_count",
        "_done",
        "_fitted",
        "_home",
        "_known",
        "_lasted",
        "_later",
        "_lean",
        "_log",
        "_on_black",
        "_outside",
        "_recent",
        "_sensor",
        "_start",
        "_step",
        "_stray_first",
        "_stray_way",
        "_sum",
        "_told",
        "jumps",
        "stray",
        "unread",
    )

    def __init__(self, white: Surface, black: Surface) -> None:
        super().__init__(white, black)
        heights = [each.height for each in explanations(white.mean, black.mean)] or [USUAL_HEIGHT]
        self._sensor = Sensor(
            self._share,
            self._share_sd,
            self._floor,
            self._own_dark,
            usual_spot(sum(heights) / len(heights)),
            pattern_of(white.sd**2, self.light, CONVERTER_NOISE),
            CONVERTER_NOISE**0.5,
        )
        self._bank: Hypotheses | None = None
        self._on_black: bool | None = None
        self._fitted = False  # whether a reading has been one of a surface yet
        self._recent = NOTHING  # the last readings on one surface, oldest first
        self._log: list[tuple[float, float]] = []  # counts and way of the readings since `_start`
        self._start = self._later = self._belief()
        self._home: Belief | None = None  # levels of before, where the floor or the light is another one now
        self._known = True  # whether somebody says the way
        self._told = -1e9  # the last unexplained reading that said something
        self.unread = self._stray_first = self._stray_way = self._lean = self._black_way = 0.0
        self._sum = self._step = 0.0  # counts and way of the readings that are not yet in the log
        self._count = 0
        self.stray = self.jumps = self._lasted = self._outside = self._calm = self._done = 0

    @property
    def in_doubt(self) -> bool:
        """Whether it is being weighed what changed."""
        return self._bank is not None

    @property
    def weighed(self) -> float | None:
        """P(black) by all stories that are weighed; 0.5 where black lasts so long that it may be white in
        less light; None where the levels tell, or not all readings have been weighed yet.
        """
        if self._bank is not None:
            return None if self._log else self._bank.black
        return 0.5 if self._black_way > WIDEST else None

    def update(self, counts: float, others_lost: bool | None = None, way: float | None = None) -> None:
        """Learn from a reading.

        others_lost: whether other sensors are at a loss; None: there are none. way: m that the sensor went
        over the floor since the last reading; None: not known.
        """
        known = self._known = way is not None
        way = self._gone(USUAL_WAY if way is None else way)
        log = self._log
        if self._bank is not None:
            if not self._bank.on_edge or self._news(counts, way):
                self._note(counts, way)
            if log:
                self._weigh(self._bank, others_lost)
            return
        on_black = counts >= self.threshold
        miss = counts - (self.black if on_black else self.white)
        spread = self.sd_black if on_black else self.sd_white
        if not -GATE * spread <= miss <= GATE * spread:
            if self._news(counts, way):
                self._note(counts, way)
                self._stray(counts, way)
            return
        self._note(counts, way)
        self._fitted = True
        if on_black is not self._on_black:
            if self._on_black is not None and not self._is_crossed(way, known):
                self._begin()
                return
            self._on_black = on_black
            self._lasted = 0
        if self.stray:
            self.stray = self._lasted = 0
        oldest, older, old = self._recent
        self._recent = (older, old, counts)
        change = counts - oldest
        noise = self._dark_noise if on_black else self._light_noise
        lasted = self._lasted = self._lasted + 1
        lean = self._lean = self._lean + LEAN_SHARE * (miss / spread - self._lean) if lasted > 1 else 0.0
        if lasted > LEAN_READINGS and not -MOST_LEAN <= lean <= MOST_LEAN:
            self._begin()
            return
        # At the converter's bottom a reading tells of no light: half a count there is all of it.
        if change * change <= LEVEL * LEVEL * (noise + LEAST_SD) and (on_black or self.white > ANALOG_BOTTOM):
            self._learn(counts, on_black, miss, noise)
            self._refresh()
        if on_black:
            self._black_way += way
            if self._black_way > WIDEST and self.status is Status.OK:
                self.status = Status.UNCERTAIN
        else:
            self._black_way = 0.0
        if len(log) >= 2 * REMEMBERED:
            del log[:-REMEMBERED]
            self._start, self._later = self._later, self._belief()

    def _is_crossed(self, way: float, known: bool) -> bool:
        """Whether it was an edge that lies behind the sensor, over the last part of which it went `way` m."""
        went = self._stray_way if self.stray else 0.0
        return self._is_edge(self._sensor.spot, went - self._stray_first, went + way, known)

    def _gone(self, way: float) -> float:
        """m since the last reading, `way` of them in this tick."""
        way, unread, self.unread = way + self.unread, self.unread, 0.0
        if unread and way > self._sensor.spot:  # what was crossed meanwhile nobody saw
            self.restart()
            return 0.0
        return way

    def _note(self, counts: float, way: float) -> None:
        """Keep a reading for the bank: one mean of those on `STEP` of the way.

        A spot that goes slowly sees the same floor for many readings, and they tell of it no more than one.
        """
        count = self._count = self._count + 1
        self._sum += counts
        way = self._step = self._step + way
        if way >= STEP or count >= MOST_IN_ONE:
            self._log.append((self._sum / count, way))
            self._sum = self._step = 0.0
            self._count = 0

    def _news(self, counts: float, way: float) -> bool:
        """Whether an unexplained reading says anything: one more of a sensor that stands still does not.

        Half on a line it reads what no surface does, for as long as it stands there.
        """
        apart = counts - self._told
        if way < STILL and apart * apart < GATE * GATE * (self._light_noise + self._dark_noise):
            return False
        self._told = counts
        return True

    def _stray(self, counts: float, way: float) -> None:
        """A reading that belongs to no surface: an edge, until it takes too long or lies beyond both."""
        if self.stray == 0:
            self._stray_first, self._stray_way = way, 0.0
            self._outside = 0
        self._recent = NOTHING
        if not self._fitted:
            self.status = Status.UNCERTAIN
        self.stray += 1
        self._stray_way += way
        self._outside = self._outside + 1 if counts < self.white or counts > self.black else 0
        too_far = self._stray_way - self._stray_first > longest(self._known) * self._sensor.spot + way
        beyond = self._outside >= (OUTSIDE_AT_START if self._on_black is None else MOST_OUTSIDE)
        if too_far or beyond or self.stray >= MOST_STRAY:
            self._begin()

    def _belief(self) -> Belief:
        unseen_light, unseen_dark = self._unseen_light(), self._unseen_dark()
        return Belief(
            self.light,
            self.dark,
            self._light_var + unseen_light * unseen_light,
            self._cross,
            self._dark_var + unseen_dark * unseen_dark,
            self._on_black,
        )

    def _begin(self) -> None:
        sensor = self._sensor
        if not self._fitted:  # somebody may have put the sensor higher than it was calibrated
            sensor = sensor.higher(self._farthest)
        self._bank = Hypotheses(sensor, self._start, self._home)
        self._done = self._calm = 0
        self.status = Status.UNCERTAIN

    def _weigh(self, bank: Hypotheses, others_lost: bool | None) -> None:
        """The next readings for the bank; its levels are followed where it is sure enough."""
        log = self._log
        last = min(self._done + CATCH_UP, len(log))
        for counts, way in log[self._done : last]:
            bank.update(counts, way, others_lost, self._known)
        self._done = last
        if last < len(log):
            return
        counts = log[-1][0]
        log.clear()
        self._done = 0
        sure = bank.sure
        self._calm = self._calm + 1 if bank.steady >= STEADY else 0
        # While an edge is being crossed even the likelier story is often wrong for a reading or two. But
        # levels that do not fit where a robot was put down say less still.
        calm = self._on_black is None or self._calm >= CALM_READINGS
        if sure >= BELIEVED or (sure >= LIKELIER and calm):
            self._follow(bank.best(), counts)
        if sure < SURE:
            self.status = Status.UNCERTAIN
        elif self._calm >= STEADY_READINGS:
            self._move_home()
            self._end()

    def _move_home(self) -> None:
        """Remember the levels of before the doubt where they are others now: they may come again."""
        home, before = self._home, self._start
        if home is not None and abs(self.light - home.light) < FLOOR * home.light:
            self._home = None
        elif home is None and before.on_black is not None:
            self._home = before if abs(self.light - before.light) > FLOOR * before.light else None

    def _follow(self, belief: Belief, counts: float) -> None:
        """Take over what the bank believes."""
        was_black = counts >= self.threshold
        self.light, self.dark, self._light_var, self._cross, self._dark_var, self._on_black = belief
        self._light_anchor, self._dark_anchor = self.light, self.dark
        if not self._fitted:
            self._sensor = self._sensor.higher(DARKEST * self.light)
            self._own_dark = self._sensor.least_dark
        self._refresh()
        if was_black is not (counts >= self.threshold):
            self.jumps += 1

    def restart(self) -> None:
        """Begin anew with the levels as they are, after readings that were not given."""
        self._on_black = None
        self.unread = 0.0
        self._log.clear()
        self._sum = self._step = 0.0
        self._count = 0
        self._end()

    def _end(self) -> None:
        self._bank = None
        self._lasted = 0
        self._start = self._later = self._belief()
        self._recent = NOTHING
        self.stray = 0
