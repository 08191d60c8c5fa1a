"""Classification of one tophat at run time: white or black at every reading, with hysteresis, debounce and
edge times."""

from __future__ import annotations

import math
from typing import NamedTuple

from raccoon.core.errors import ConfigError
from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP, Status
from raccoon.estimate.tophat.calibration import TophatCalibration
from raccoon.estimate.tophat.flicker import FlickerWatch
from raccoon.estimate.tophat.jumps import JumpWatch
from raccoon.estimate.tophat.levels import GATE_SDS
from raccoon.estimate.tophat.tracker import LightTracker
from raccoon.model.reflectance import FULL_SCALE, light_of

LOST_READINGS = 5  # unexplained readings in a row; an edge has fewer
SPIKE_RATIO = 4.0  # least |after - spike| / |after - before| of the readings around a spike
READINGS_BETWEEN_SPIKES, READINGS_AFTER_EDGE = 20, 4
"""Least numbers of readings between two spikes, and from an edge to a spike; lamps that flicker come
sooner."""
READINGS_AFTER_LAMPS = 200
"""Readings without flicker after which the lamps are off, rather than hidden by edges."""
BEYOND_READINGS = 4  # readings in a row beyond both surfaces; no edge has so many


class Edge(NamedTuple):
    """A border between white and black that the sensor crossed.

    time: s, at half of the spot on black, interpolated between readings. to_black: from white to black.
    """

    time: float
    to_black: bool


class TophatReading(NamedTuple):
    """The classification at one tick.

    black: None while unknown. darkness: P(black), 0..1. coverage: share of the spot on black, 0..1; unlike
    counts it is linear in the distance across an edge. edge: set in the tick that detected one. status:
    reliability of all of it.
    """

    black: bool | None
    darkness: float
    coverage: float
    status: Status
    edge: Edge | None


UNKNOWN = TophatReading(None, 0.5, 0.5, Status.INVALID, None)


class Tophat:
    """Classifier of one sensor. Call `update` with every reading in order of time.

    adapt: follow the light (see `tracker`); may be switched at any time, and should be off while the sensor
    is kept on the edge of a line, where its readings are of neither surface. debounce: readings in a row on
    the other side that make a change (with 2, a single spike never does).

    Raises CalibrationError for a calibration without a threshold, ConfigError for a debounce below 1.
    """

    def __init__(self, calibration: TophatCalibration, *, adapt: bool = True, debounce: int = 2) -> None:
        if debounce < 1:
            raise ConfigError(f"debounce = {debounce}: allowed are whole numbers from 1")
        white, black = calibration.surfaces()
        self._adapt = adapt
        self.levels = LightTracker(white, black)
        self._debounce = debounce
        self._flicker = FlickerWatch(calibration.flickers)
        self._jumps = JumpWatch()
        levels = self.levels
        levels.threshold = calibration.threshold or levels.threshold
        levels.low, levels.high = calibration.low or levels.low, calibration.high or levels.high
        self._is_black: bool | None = None
        self._opposite_readings = 0  # readings in a row opposite to the state
        self._last_time = self._last_counts = self._last_coverage = 0.0
        self._time = self._light = 0.0  # time and light of the reading that was taken
        self._way: float | None = None  # its distance
        self._last_followed = 0.0  # last reading given to the levels
        self._waiting: tuple[float, float | None] | None = None  # a waiting reading and its distance
        self._readings_until_wait = 0  # readings until another one may wait, after an edge or flicker
        self._spike_readings = 0  # counts down; + `READINGS_BETWEEN_SPIKES` for each spike
        self._beyond_readings = 0  # readings in a row beyond both surfaces
        self._edge_time = 0.0  # last time at half coverage
        self._seen_changes = 0
        self.missed = True
        """Whether the last tick had no reading, or one that was discarded."""

    @property
    def adapt(self) -> bool:
        """Whether the levels follow the light."""
        return self._adapt

    @adapt.setter
    def adapt(self, on: bool) -> None:
        if on and not self._adapt:
            self.levels.restart()
            self._waiting, self._last_followed = None, self._last_counts
        self._adapt, self._beyond_readings = on, 0

    @property
    def other_light(self) -> bool:
        """Whether the readings show another light while the light is not followed: so different that it moves
        half an edge by 2 mm."""
        return self._beyond_readings >= BEYOND_READINGS

    def relearn(self, white: float, black: float) -> bool:
        """Set these counts as white and black, from both sides of an edge in the present light.

        Returns False, without a change, if they are too similar for two surfaces.
        """
        if not self.levels.relearn(white, black):
            return False
        self._beyond_readings, self._is_black = 0, self._last_counts >= self.levels.threshold
        return True

    @property
    def counts(self) -> float:
        """The last valid reading, with the flicker of lamps averaged out."""
        return self._last_counts

    @property
    def threshold(self) -> float:
        """Counts from which a reading is black, in the present light."""
        return self.levels.threshold

    def update(
        self,
        time: float,
        counts: float | None,
        others_lost: bool | None = None,
        way: float | None = None,
    ) -> TophatReading:
        """Classify the reading of this tick.

        time: s. counts: None if there is no new reading; one at an end of the range far from both surfaces
        counts as None. others_lost: see `TophatGroup`, which sets it. way: m that the sensor moved over the
        floor since the last tick (None: unknown, 0.24 m/s is assumed); the length of an edge distinguishes it
        from a change of light.
        """
        self.take(time, counts, others_lost, way)
        if self.levels.is_bank_due:
            LightTracker.run_banks((self.levels,))
        return self.classify()

    def take(
        self,
        time: float,
        counts: float | None,
        others_lost: bool | None = None,
        way: float | None = None,
    ) -> None:
        """Take the reading of this tick, as `update` does. `LightTracker.run_banks` and
        `classify` have to follow."""
        self._way = way
        self.missed = counts is None or self._is_at_rail(counts)
        if counts is None or self.missed:
            self._jumps.skip(way)
            self._skip(way)
            return
        counts = float(counts)
        levels = self.levels
        flicker = self._flicker
        flicker.update(counts)
        light = light_of(counts)
        if self._is_black is None:
            self._last_followed = counts
        # The classifier uses readings with the flicker of lamps averaged out.
        self._time, light = flicker.mean(time, light)
        if flicker.hertz:
            counts = FULL_SCALE / (1.0 + light)
        self._last_counts, self._light = counts, light
        if self._jumps.is_held:
            self._skip(way)
        elif self._adapt:
            self._follow(counts, others_lost, way)
        else:
            self._beyond_readings = self._beyond_readings + 1 if levels.is_beyond(counts, light) else 0

    def classify(self) -> TophatReading:
        """Classify the reading that was taken."""
        if self.missed:
            return self._unsure_reading()
        time, counts, light, levels = self._time, self._last_counts, self._light, self.levels
        coverage = (levels.light - light) / (levels.light - levels.dark)
        coverage = 0.0 if coverage < 0.0 else 1.0 if coverage > 1.0 else coverage
        self._jumps.update(counts, coverage, self._way, sure=not levels.is_in_doubt)
        last = self._last_coverage
        if levels.late_changes != self._seen_changes:
            # A change of light is certain only now: another answer, but no edge.
            self._seen_changes, last = levels.late_changes, coverage
            self._is_black, self._opposite_readings = counts >= levels.threshold, 0
        if (coverage >= 0.5) is not (last >= 0.5):
            share = (0.5 - last) / (coverage - last)
            self._edge_time = self._last_time + share * (time - self._last_time)
        self._last_time, self._last_coverage = time, coverage
        edge = self._decide(counts)
        if self._jumps.is_held:
            return self._unsure_reading()
        return TophatReading(self._is_black, self._probability(counts), coverage, levels.status, edge)

    def _unsure_reading(self) -> TophatReading:
        """The answer without a reading of a surface: that of before."""
        if self._is_black is None:
            return UNKNOWN
        coverage = float(self._is_black) if self._jumps.is_held else self._last_coverage
        return TophatReading(self._is_black, 0.5, coverage, Status.UNCERTAIN, None)

    def _skip(self, way: float | None) -> None:
        """Give the tracker no reading, only the distance."""
        waiting, self._waiting = self._waiting, None  # unknown whether it was a spike
        self.levels.unread_way += (way or 0.0) + (0.0 if waiting is None else waiting[1] or 0.0)

    def _follow(self, counts: float, others_lost: bool | None, way: float | None) -> None:
        """Give the reading to the tracker that follows the light.

        A reading far from the one before waits for the next one: a spike is far from both, and is not
        followed. Lamps that flicker swing as far at every reading, and spikes do not.
        """
        levels, waiting, before = self.levels, self._waiting, self._last_followed
        self._waiting, self._last_followed = None, counts
        if self._flicker.hertz:
            self._readings_until_wait = READINGS_AFTER_LAMPS
            levels.update(counts, others_lost, way)
            return
        if waiting is not None:
            waiting_counts, waiting_way = waiting
            self._readings_until_wait = READINGS_AFTER_EDGE
            if abs(counts - waiting_counts) > SPIKE_RATIO * abs(counts - before):
                waiting_counts, self._readings_until_wait = before, -1
                self._spike_readings += READINGS_BETWEEN_SPIKES
            levels.update(0.5 * (before + waiting_counts), others_lost, waiting_way)
            before = waiting_counts
        spread = GATE_SDS * (levels.sd_black if before >= levels.threshold else levels.sd_white)
        self._readings_until_wait -= 1
        if self._spike_readings:
            self._spike_readings -= 1
        may_wait = self._readings_until_wait < 0 and self._spike_readings < READINGS_BETWEEN_SPIKES
        if may_wait and not -spread <= counts - before <= spread:
            self._waiting, self._last_followed = (counts, way), before
            return
        levels.update(0.5 * (before + counts), others_lost, way)

    def _is_at_rail(self, counts: float) -> bool:
        """Whether the converter is at an end of its range and neither surface is there: a loose wire, or two
        that touch. No floor reads that, and no abyss."""
        if ANALOG_BOTTOM < counts < ANALOG_TOP:
            return False
        levels = self.levels
        if counts >= ANALOG_TOP:
            return levels.black + 2.0 * levels.sd_black < ANALOG_TOP
        return levels.white - 2.0 * levels.sd_white > ANALOG_BOTTOM

    @property
    def lost(self) -> bool:
        """Whether neither surface explains the readings, or the bank is deciding what changed."""
        return self.levels.unexplained >= LOST_READINGS or self.levels.is_in_doubt

    def _decide(self, counts: float) -> Edge | None:
        levels = self.levels
        is_black = self._is_black
        if is_black is None:
            self._is_black = counts >= levels.threshold
            return None
        if counts < levels.high if not is_black else counts > levels.low:
            self._opposite_readings = 0
            self._jumps.release()
            return None
        readings = self._opposite_readings = self._opposite_readings + 1
        held = self._jumps.holds(self._last_coverage, readings, to_black=not is_black)
        if held or readings < self._debounce + self._flicker.extra_debounce(to_black=not is_black):
            return None
        self._is_black, self._opposite_readings = not is_black, 0
        return Edge(self._edge_time, not is_black)

    def _probability(self, counts: float) -> float:
        """P(black): by the bank while it is at work, else logistic in the distance to the threshold, in units
        of the surfaces' standard deviations."""
        levels = self.levels
        weighed = levels.bank_probability if self._adapt else None
        if weighed is not None:
            return weighed
        gap = levels.black - levels.white
        spread = levels.sd_white + levels.sd_black
        least = gap / 6.0
        scale = spread if spread > least else least
        odds = 4.0 * gap * (counts - levels.threshold) / (scale * scale)
        return 1.0 / (1.0 + math.exp(-odds)) if odds > -700.0 else 0.0
