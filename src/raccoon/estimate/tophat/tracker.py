"""Tracking of the white and black levels in changing light.

A surface's filter (`levels`) learns from the readings that the surface explains. Readings that neither
surface explains are an edge being crossed, as long as the distance driven meanwhile fits one. If it does not,
or if such readings last, a bank of hypotheses (`hypotheses`) processes all recent readings and decides
whether the light or the surface changed. It stays in charge until one mode is certain; until then the status
is `uncertain`.
"""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP, Status
from raccoon.estimate.tophat.calibration import MIN_SD, Surface
from raccoon.estimate.tophat.hypotheses import (
    Belief,
    HypothesisBank,
    Reading,
    Sensor,
    pattern_share,
    spot_width,
    update_banks,
)
from raccoon.estimate.tophat.levels import CONVERTER_VARIANCE, FLOOR_SPREAD, GATE_SDS, Levels, max_edge_share
from raccoon.estimate.tophat.reading_log import ReadingLog
from raccoon.estimate.tophat.resting_place import RestingPlace
from raccoon.estimate.tophat.sensor import DARKEST_WHITE_SHARE, explain_levels

# bound in standard deviations on the change of readings that are learnt; on an edge it is larger
LEVEL_SDS = 2.0
USUAL_WAY_M = 0.0012  # m per reading if unknown: 0.24 m/s at 200 Hz
USUAL_HEIGHT_M = 0.012  # m, of a sensor of neither generation
MAX_UNEXPLAINED, MAX_OUTSIDE = 120, 6  # most readings that neither surface explains, and most beyond both
MAX_OUTSIDE_AT_START = 2  # the same where the robot was put down
MAX_CAUGHT_UP_PER_TICK = 3  # logged readings that a bank takes in one tick
FOLLOWED_IN_CALM, FOLLOWED_ALWAYS, DECIDED = 0.6, 0.9, 0.99  # least to adopt levels, to stop the bank
CALM_PROBABILITY = 0.95  # least probability of steady light in a calm reading
CALM_READINGS, STEADY_READINGS = 4, 8
WIDEST_LINE_M = 0.15  # m of black above which it may be white in less light
RESIDUAL_SMOOTHING = 0.1  # weight of a reading in the mean residual of the levels
MIN_RESIDUAL_READINGS = 15  # on one surface, for a mean residual; a line is shorter
MAX_MEAN_RESIDUAL = 1.5  # in standard deviations; above it the light changes faster than the levels
NO_READINGS = (-1e9, -1e9, -1e9)


class LightTracker(Levels):
    """Levels that follow the light: call `update` with every reading, then see `Levels`.

    is_bank_due: whether the bank has readings to process in this tick. late_changes: number of changes of
    light that were noticed so late that readings had been assigned to the wrong surface. unexplained:
    readings in a row that neither surface explains. unread_way: m that the sensor moved since the last
    reading while there was none; the next reading covers that distance, too.
    """

    __slots__ = (
        "_bank",
        "_black_way",
        "_calm_readings",
        "_first_unexplained_way",
        "_former",
        "_has_fitted",
        "_log",
        "_mean_residual",
        "_next_start",
        "_on_black",
        "_others_lost",
        "_outside_readings",
        "_recent",
        "_resting",
        "_same_readings",
        "_sensor",
        "_start",
        "_unexplained_way",
        "_way_known",
        "is_bank_due",
        "late_changes",
        "unexplained",
        "unread_way",
    )

    def __init__(self, white: Surface, black: Surface) -> None:
        super().__init__(white, black)
        heights = [each.height for each in explain_levels(white.mean, black.mean)] or [USUAL_HEIGHT_M]
        shares, least = (self._black_share, self._black_share_sd), (self._least_light, self._least_dark)
        spot = spot_width(sum(heights) / len(heights))
        pattern = pattern_share(white.sd**2, self.light, CONVERTER_VARIANCE)
        self._sensor = Sensor(*shares, *least, spot, pattern, CONVERTER_VARIANCE**0.5)
        self._bank: HypothesisBank | None = None
        self.is_bank_due = False
        self._others_lost: bool | None = None
        self._on_black: bool | None = None
        self._has_fitted = False  # whether a reading has fitted a surface yet
        self._recent = NO_READINGS  # the last readings on one surface, oldest first
        self._log = ReadingLog()  # readings since `_start`
        self._start = self._next_start = self._belief()
        self._former: Belief | None = None  # levels before a change of floor or light, which may come back
        self._way_known = True  # whether the distance is known
        self._resting = RestingPlace()
        self.unread_way = self._first_unexplained_way = self._unexplained_way = 0.0
        self._mean_residual = self._black_way = 0.0
        self.unexplained = self.late_changes = 0
        self._same_readings = self._outside_readings = self._calm_readings = 0

    @property
    def is_in_doubt(self) -> bool:
        """Whether the bank is at work: something changed, and it is not yet certain what."""
        return self._bank is not None

    @property
    def bank_probability(self) -> float | None:
        """P(black) by the bank; 0.5 if black lasts so long that it may be white in less light; None if the
        levels decide, or if the bank has not processed all readings yet."""
        if self._bank is not None:
            return None if self._log.entries else self._bank.black
        return 0.5 if self._black_way > WIDEST_LINE_M else None

    def update(self, counts: float, others_lost: bool | None = None, way: float | None = None) -> None:
        """Learn from a reading; `run_banks` has to follow.

        others_lost: whether other sensors are lost; None: there are none. way: m that the sensor moved over
        the floor since the last reading; None: unknown.
        """
        way_known = self._way_known = way is not None
        way = self._way_since_reading(USUAL_WAY_M if way is None else way)
        if self._resting.before is not None:
            self._find_resting_place(counts, way)
        if self._bank is not None:
            if not self._bank.on_edge or self._resting.is_informative(counts, way, self):
                self._log.add(counts, way)
            self._others_lost, self.is_bank_due = others_lost, bool(self._log.entries)
            return
        on_black = counts >= self.threshold
        level, spread = (self.black, self.sd_black) if on_black else (self.white, self.sd_white)
        residual = counts - level
        if not -GATE_SDS * spread <= residual <= GATE_SDS * spread:
            if self._resting.is_informative(counts, way, self):
                self._log.add(counts, way)
                self._take_unexplained(counts, way)
            return
        self._log.add(counts, way)
        self._has_fitted = True
        if on_black is not self._on_black:
            if self._on_black is not None and not self._has_crossed_edge(way, way_known):
                self._start_bank(way)
                return
            self._on_black = on_black
            self._same_readings = 0
        if self.unexplained:
            self.unexplained = self._same_readings = 0
        oldest, older, old = self._recent
        self._recent = (older, old, counts)
        change = counts - oldest
        noise = self._dark_noise if on_black else self._light_noise
        same_readings = self._same_readings = self._same_readings + 1
        mean, scaled = self._mean_residual, residual / spread
        mean = self._mean_residual = mean + RESIDUAL_SMOOTHING * (scaled - mean) if same_readings > 1 else 0.0
        if same_readings > MIN_RESIDUAL_READINGS and not -MAX_MEAN_RESIDUAL <= mean <= MAX_MEAN_RESIDUAL:
            self._start_bank(way)
            return
        is_level = change * change <= LEVEL_SDS * LEVEL_SDS * (noise + MIN_SD)
        # At an end of the converter's range a reading holds no light: at the top, that of both would go to 0.
        if is_level and level < ANALOG_TOP and (on_black or level > ANALOG_BOTTOM):
            self._learn(counts, on_black, residual, noise)
            self._refresh()
        if on_black:
            self._black_way += way
            if self._black_way > WIDEST_LINE_M and self.status is Status.OK:
                self.status = Status.UNCERTAIN
        else:
            self._black_way = 0.0
        if self._log.trim():
            self._start, self._next_start = self._next_start, self._belief()

    def _find_resting_place(self, counts: float, way: float) -> None:
        """End the doubt if the sensor stands and has been put on a surface of before."""
        before = self._resting.find_surface(counts, way)
        if before is not None:
            self._adopt(before, counts)
            self.restart()
            self.late_changes += 1

    def _has_crossed_edge(self, way: float, way_known: bool) -> bool:
        """Whether the sensor has just crossed an edge, with `way` m since the reading before."""
        unexplained = self._unexplained_way if self.unexplained else 0.0
        shortest, longest = unexplained - self._first_unexplained_way, unexplained + way
        return self._is_edge(self._sensor.spot, shortest, longest, way_known)

    def _way_since_reading(self, way: float) -> float:
        """m since the last reading, `way` of them in this tick."""
        way, unread, self.unread_way = way + self.unread_way, self.unread_way, 0.0
        if unread and way > self._sensor.spot:  # an edge may have been crossed unseen
            self.restart()
            return 0.0
        return way

    def _take_unexplained(self, counts: float, way: float) -> None:
        """Process a reading that fits no surface: an edge, until it takes too long or is beyond both
        surfaces."""
        if self.unexplained == 0:
            self._first_unexplained_way, self._unexplained_way = way, 0.0
            self._outside_readings = 0
        self._recent = NO_READINGS
        if not self._has_fitted:
            self.status = Status.UNCERTAIN
        self.unexplained += 1
        self._unexplained_way += way
        is_outside = counts < self.white or counts > self.black
        self._outside_readings = self._outside_readings + 1 if is_outside else 0
        longest = max_edge_share(self._way_known) * self._sensor.spot + way
        too_far = self._unexplained_way - self._first_unexplained_way > longest
        beyond = self._outside_readings >= (MAX_OUTSIDE_AT_START if self._on_black is None else MAX_OUTSIDE)
        if too_far or beyond or self.unexplained >= MAX_UNEXPLAINED:
            self._start_bank(way)

    def _belief(self) -> Belief:
        unseen_light, unseen_dark = self._unseen_light_sd(), self._unseen_dark_sd()
        light_var = self._light_var + unseen_light * unseen_light
        dark_var = self._dark_var + unseen_dark * unseen_dark
        return Belief(self.light, self.dark, light_var, self._cross, dark_var, self._on_black)

    def _start_bank(self, way: float) -> None:
        sensor = self._sensor
        self._resting.begin(way, self._start, self, self._least_light)
        if not self._has_fitted:  # the sensor may be higher than at its calibration
            sensor = sensor.with_least_light(self._least_light_far)
        self._bank = HypothesisBank(sensor, self._start, self._former)
        self._calm_readings = 0
        self.status = Status.UNCERTAIN

    @staticmethod
    def run_banks(trackers: Sequence[LightTracker]) -> None:
        """Let the banks of sensors that are in doubt process their next readings, once a tick."""
        for _ in range(MAX_CAUGHT_UP_PER_TICK):
            due = [(each, each._bank) for each in trackers if each.is_bank_due and each._bank is not None]
            if not due:
                return
            readings = [Reading(*each._log.take(), each._others_lost, each._way_known) for each, _ in due]
            update_banks([bank for _, bank in due], readings)
            for each, bank in due:
                each._take_bank(bank)
        for each in trackers:
            each.is_bank_due = False

    def _take_bank(self, bank: HypothesisBank) -> None:
        """Adopt the bank's levels if it has processed all readings and is certain enough."""
        log = self._log
        self.is_bank_due = log.taken < len(log.entries)
        if self.is_bank_due:
            return
        counts = log.entries[-1][0]
        log.clear()
        sure = bank.sure
        self._calm_readings = self._calm_readings + 1 if bank.steady >= CALM_PROBABILITY else 0
        # On an edge even the likelier mode is often wrong for a reading or two. But after the robot was put
        # down, levels that do not fit are worse.
        calm = self._on_black is None or self._calm_readings >= CALM_READINGS
        if sure >= FOLLOWED_ALWAYS or (sure >= FOLLOWED_IN_CALM and calm):
            self._adopt(bank.best_belief(), counts)
        if sure < DECIDED:
            self.status = Status.UNCERTAIN
        elif self._calm_readings >= STEADY_READINGS:
            self._remember_former_levels()
            self._stop_bank()

    def _remember_former_levels(self) -> None:
        """Remember the levels before the change if they differ from the present ones: they may return."""
        former, before = self._former, self._start
        if former is not None and abs(self.light - former.light) < FLOOR_SPREAD * former.light:
            self._former = None
        elif former is None and before.on_black is not None:
            has_changed = abs(self.light - before.light) > FLOOR_SPREAD * before.light
            self._former = before if has_changed else None

    def _adopt(self, belief: Belief, counts: float) -> None:
        """Set the levels to those of the bank."""
        was_black = counts >= self.threshold
        self.light, self.dark, self._light_var, self._cross, self._dark_var, self._on_black = belief
        self._light_anchor, self._dark_anchor = self.light, self.dark
        if not self._has_fitted:
            self._sensor = self._sensor.with_least_light(DARKEST_WHITE_SHARE * self.light)
            self._least_dark = self._sensor.least_dark
        self._refresh()
        if was_black is not (counts >= self.threshold):
            self.late_changes += 1

    def restart(self) -> None:
        """Drop the bank and its readings after a gap in the readings; the levels stay."""
        self._on_black = None
        self.unread_way = 0.0
        self._log.restart()
        self._stop_bank()

    def _stop_bank(self) -> None:
        self._bank, self.is_bank_due = None, False
        self._same_readings = 0
        self._start = self._next_start = self._belief()
        self._recent = NO_READINGS
        self.unexplained = 0
