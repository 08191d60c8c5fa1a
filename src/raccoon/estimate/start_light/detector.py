"""The start light's detector: fires once when the lamp over the sensor goes on, and on nothing else.

A light sensor reads lower in more light. Before the start the detector learns the brightest ambient light and
its noise. The lamp is a fall well beyond both that is quick and lasts. Everything similar lacks one of these:
a camera flash does not last, a shadow that leaves makes it no brighter than before the shadow, the sun comes
slowly (and is learnt).

The readings around a fall show how quick it was. If they are far apart (a slow rate, a silent link), the
light may have risen at any pace between two of them, so it must then be constant for as long as that gap. A
bulb that warms up takes longer. With a calibration its light is known: it is enough that the light gets there
within a bulb's time and stays. A bulb that takes a second or two, and one without calibration, is recognised
by the shape of its rise (`bulb.py`).
"""

from __future__ import annotations

import math
from bisect import insort
from typing import NamedTuple

from raccoon.core.readings import ANALOG_BOTTOM, Status
from raccoon.estimate.start_light import bulb
from raccoon.estimate.start_light.bulb import MEAN_SECONDS, SlowBulb
from raccoon.estimate.start_light.calibration import MIN_COUNTS, StartLightCalibration
from raccoon.estimate.start_light.history import WARM_UP_SECONDS, History
from raccoon.model.reflectance import light_of

LEARNING_SECONDS = 0.5  # s of ambient light that are learnt first
LEARNING_READINGS = 10  # readings at least: of five, a flash would be most of the noise
AMBIENT_SECONDS = 0.5  # s, time constant of the ambient level
MEMORY_SECONDS = 60.0  # s, time constant of forgetting brighter light
MIN_FALL = 0.35  # least fall without calibration, as a share of the ambient reading
CLEAR_SDS = 8.0  # noise standard deviations between ambient level and threshold
MAX_CLEAR_SHARE = 0.55  # bound on that as a share of the reading: flicker does no more than double light
QUICK_RATIO = 1.8  # light over the least light just before, above which a lamp went on
STEADY_RATIO = 1.2  # light over the light STEADY_SECONDS before, below which a lamp is fully on
STEADY_SECONDS = 0.015
STILL_RATIO = 1.1  # the same over a longer time: daylight goes on rising
HOLD_SECONDS = 0.038  # s for which a lamp must stay on
RISE_SECONDS = 0.030  # s within which it comes on
STILL_SECONDS = 0.1  # s, whole periods of light that flickers with the mains, at 50 and at 60 Hz
COARSE_SECONDS = 0.03  # s between readings; above it STILL_RATIO holds for a lamp that came at once
MIN_READINGS = 3  # least number of readings of a lamp: one may be an outlier, and at 10 Hz a flash is one
LATELY_SECONDS = 3.0  # s in which the sun may have come, and somebody's shadow over it
LONGEST_GAP_SECONDS = 0.25
"""s between two readings, above which the speed of a fall between them is unknown."""
NEAR_RATIOS = (0.5, 2.0)  # bounds on the light over the calibrated lamp's
CLEAR_RATIO = 1.45  # light over the light before: a white sleeve near the sensor adds up to 40 %
SETTLED_SECONDS = 0.3  # s for which a lamp that warms up must stay near its calibrated light
UNKNOWN_WARM_UP_SECONDS = 0.12  # s without calibration, where a shadow that leaves may look the same
PATIENCE_SECONDS = 0.6  # s for a light to become the lamp before it is refused and learnt


class StartLightReading(NamedTuple):
    """State of the detector after a reading.

    fired: the lamp went on (stays True; in a rehearsal True for one reading). ambient, threshold: counts.
    status: `invalid` while the ambient light is being learnt, `uncertain` if it is too bright to distinguish
    the lamp.
    refused: the light is bright enough and stays, but did not rise as a lamp does; True once per such light,
    which is learnt as ambient light.
    shorted: the sensor stays at the bottom of the scale, which no light causes (`ANALOG_BOTTOM`).
    """

    fired: bool
    ambient: float
    threshold: float
    status: Status
    refused: bool = False
    shorted: bool = False


class StartLight:
    """Detector of one start light. Call `update` with every reading until it fires.

    calibration: lamp levels; without one the fall must be at least 35 % of the reading. The light must come
    within 30 ms and stay for 38 ms (0.1 s without calibration) and three readings. A lamp may also warm up
    more slowly (time constant of up to 0.2 s; 0.1 s without calibration); then the detector fires 0.3 s after
    it is near its level. A bulb that takes up to two seconds, calibrated or not, fires when it is warm if it
    is ten times as bright as the light before. rehearsal: fire again each time the lamp comes on (test mode).
    """

    def __init__(self, calibration: StartLightCalibration | None = None, *, rehearsal: bool = False) -> None:
        self._lamp_counts = None if calibration is None else calibration.on
        self._lamp_light = (
            0.0 if calibration is None else light_of(calibration.on) - light_of(calibration.off)
        )
        # Light as bright as the sun doubles as quickly as a lamp at first, and then goes on rising.
        self._still_seconds = STILL_SECONDS if calibration is None else STEADY_SECONDS
        self._hold_seconds, self._rehearsal = max(HOLD_SECONDS, self._still_seconds), rehearsal
        self._ambient = self._brightest = math.nan
        self._variance = 25.0
        self._ambient_readings: list[
            float
        ] = []  # readings, sorted; _ambient_steps: steps between them, sorted
        self._ambient_steps: list[float] = []
        self._last_ambient = math.nan  # last of these readings
        self._last_learnt = math.nan  # last reading that was learnt
        self._first_time = self._last_time = math.nan
        self._is_ambient_unknown = True  # whether the ambient light is still being learnt
        self._recent = History()
        self._slow_bulb = SlowBulb()
        self._bright_since: float | None = None  # time since which it is brighter than the threshold
        self._dark_light = 0.0  # brightest light before that
        self._candidate_start = math.nan  # start of the candidate for a lamp that came at once
        self._time_before_candidate = math.nan  # time of the last reading before it
        self._candidate_readings = 0  # readings of the candidate
        self._candidate_gap = 0.0  # longest time between two readings around the candidate
        self._candidate_window = 0.0  # s to look back for the light before it
        self._near_since: float | None = None  # time since which it is as bright as the calibrated lamp
        self._is_lit = False  # the lamp is on, and was reported
        self._lit_until = -math.inf  # s, last time with the lamp on
        self._shorted_since: float | None = None  # time since which it reads the bottom of the scale
        self._is_refused = (
            False  # it was no lamp: wait until it is over or learnt, or a lamp comes on besides
        )
        self.fired = False
        self.fires = 0

    def update(self, time: float, counts: float | None) -> StartLightReading:
        """Take the reading of this tick (s, counts; None: no new reading)."""
        if counts is None or (self.fired and not self._rehearsal):
            return self._reading(fired=self.fired and not self._rehearsal)
        if counts <= ANALOG_BOTTOM:  # no light: treated as no reading
            self._shorted_since = time if self._shorted_since is None else self._shorted_since
            return self._reading(fired=False, shorted=time - self._shorted_since > STILL_SECONDS)
        self._shorted_since = None
        if math.isnan(self._first_time):
            self._first_time = self._last_time = time
        dt, self._last_time = time - self._last_time, time
        threshold = self.threshold
        self._recent.add(time, counts)
        self._slow_bulb.add(time, counts)
        self._is_ambient_unknown = (
            time - self._first_time < LEARNING_SECONDS or len(self._ambient_readings) < LEARNING_READINGS
        )
        if self._is_ambient_unknown:
            self._learn_first(counts)
            return self._reading(fired=False)
        if counts > threshold:
            self._bright_since = self._near_since = None
            self._is_lit = self._is_refused = False
            self._learn_ambient(counts, dt)
            return self._reading(fired=False)
        return self._decide(time, counts, dt)

    @property
    def threshold(self) -> float:
        """Counts below which it is brighter than any ambient light so far."""
        if math.isnan(self._brightest):
            return 0.0
        noise = min(CLEAR_SDS * math.sqrt(self._variance), MAX_CLEAR_SHARE * self._brightest)
        clear = max(MIN_COUNTS, noise)
        if self._lamp_counts is None:
            return min((1.0 - MIN_FALL) * self._brightest, self._brightest - clear)
        return min(
            math.sqrt(max(self._lamp_counts, 1.0) * max(self._brightest, 1.0)), self._brightest - clear
        )

    def _decide(self, time: float, counts: float, dt: float) -> StartLightReading:
        if self._bright_since is None:
            self._bright_since, self._dark_light = time, light_of(self._brightest)
            self._begin_candidate(time)
        elif time > self._candidate_end and light_of(counts) > QUICK_RATIO * self._recent.light_at(
            time - RISE_SECONDS
        ):
            self._begin_candidate(time)  # a lamp may come on while something else is bright
        self._candidate_readings += 1
        self._candidate_gap = max(self._candidate_gap, dt)
        if not self._is_like_lamp(counts):
            self._near_since = None
        elif self._near_since is None:
            self._near_since = time
        if self._is_lit:
            self._lit_until = time
        if self._is_lit or (self._is_refused and time > self._candidate_end):
            self._learn_ambient(counts, dt)
            return self._reading(fired=False)
        slowly = self._near_since is not None and self._slow_bulb.is_warm(self._dark_light)
        if self._has_come_on(time, counts) or self._has_warmed_up(time, counts) or slowly:
            self._is_lit = True  # a rehearsal fires once until the lamp is off again
            self.fired = True
            self.fires += 1
            return self._reading(fired=True)
        # Nothing is learnt before: a lamp that warms up would be learnt, and never detected.
        waited = time - (self._bright_since if self._near_since is None else self._near_since)
        warming = self._slow_bulb.is_rising(time) and time - self._bright_since < bulb.PATIENCE_SECONDS
        refused = not self._is_refused and waited > PATIENCE_SECONDS and not warming
        self._is_refused = self._is_refused or refused
        return self._reading(fired=False, refused=refused)

    def _begin_candidate(self, time: float) -> None:
        self._candidate_start, self._time_before_candidate = time, self._recent.time_before
        self._candidate_readings, self._candidate_gap, self._candidate_window = 0, 0.0, 0.0

    @property
    def _candidate_end(self) -> float:
        """Latest time of the second last reading at which the light can still count as coming at once."""
        return self._candidate_start + max(self._hold_seconds, self._candidate_gap) + RISE_SECONDS

    def _has_come_on(self, time: float, counts: float) -> bool:
        """Whether the light doubled at once, as far as the readings show, and is constant since."""
        held = time - self._candidate_start
        if (
            self._candidate_readings < MIN_READINGS
            or held < max(self._hold_seconds, self._candidate_gap) - 1e-6
        ):
            return False
        if self._candidate_gap > LONGEST_GAP_SECONDS or self._recent.time_before > self._candidate_end:
            return False
        if self._candidate_window == 0.0:
            # However far apart readings are, the window contains the last one before the fall.
            self._candidate_window = max(
                self._hold_seconds + RISE_SECONDS, time - self._time_before_candidate
            )
        light, before = light_of(counts), self._recent.least_light(time - self._candidate_window)
        # A gap hides the rise: afterwards the light must be constant for as long as the gap.
        span = max(self._still_seconds, self._candidate_gap)
        steady = STEADY_RATIO if span < COARSE_SECONDS else STILL_RATIO
        if not (light > QUICK_RATIO * before and light < steady * self._recent.least_light(time - span)):
            return False
        return self._is_brighter_than_lately(light, self._candidate_start - MEAN_SECONDS)

    def _is_like_lamp(self, counts: float) -> bool:
        """Whether it is as bright as the calibrated lamp; without calibration, clearly brighter than
        before."""
        light, dark = light_of(counts), light_of(self._brightest)
        if self._lamp_counts is None:
            return light > QUICK_RATIO * dark
        near = NEAR_RATIOS[0] * self._lamp_light <= light - dark <= NEAR_RATIOS[1] * self._lamp_light
        return near and light > CLEAR_RATIO * dark

    def _has_warmed_up(self, time: float, counts: float) -> bool:
        """Whether the light rose within a bulb's time, in any number of readings, and is constant since."""
        if self._near_since is None or time - self._near_since < SETTLED_SECONDS - 1e-6:
            return False
        light = light_of(counts)
        if light >= STILL_RATIO * self._recent.least_light(time - STILL_SECONDS):
            return False
        if not self._is_brighter_than_lately(light, time - SETTLED_SECONDS - WARM_UP_SECONDS):
            return False
        limit = WARM_UP_SECONDS if self._lamp_counts is not None else UNKNOWN_WARM_UP_SECONDS
        return self._recent.rise_seconds(light_of(self._brightest), light_of(counts)) <= limit

    def _is_brighter_than_lately(self, light: float, before: float) -> bool:
        """Without calibration: whether it is clearly brighter than recently, even if that is not learnt
        yet."""
        if self._lamp_counts is not None:
            return True
        since = max(before - LATELY_SECONDS, self._lit_until)  # a rehearsal has seen the lamp itself
        return light > QUICK_RATIO * self._slow_bulb.most_light(since, before)

    def _learn_first(self, counts: float) -> None:
        """Ambient level and noise from the medians so far, so that a flash while learning spoils neither."""
        ordered, steps = self._ambient_readings, self._ambient_steps
        if ordered:
            insort(steps, abs(counts - self._last_ambient))
            # the median step of noise is 0.95 standard deviations
            self._variance = steps[len(steps) // 2] ** 2 + 9.0
        self._last_ambient = counts
        insort(ordered, counts)
        self._ambient = self._brightest = ordered[len(ordered) // 2]

    def _learn_ambient(self, counts: float, dt: float) -> None:
        share = min(dt / AMBIENT_SECONDS, 1.0)
        self._ambient += share * (counts - self._ambient)
        # Between readings: a level that drifts is not noise, nor is the end of a flash.
        step = 0.0 if math.isnan(self._last_learnt) else counts - self._last_learnt
        self._last_learnt = counts
        self._variance += 0.3 * share * (min(0.5 * step * step, 9.0 * self._variance) - self._variance)
        self._brightest += min(dt / MEMORY_SECONDS, 1.0) * (self._ambient - self._brightest)
        self._brightest = min(self._brightest, self._ambient)

    def _reading(self, *, fired: bool, refused: bool = False, shorted: bool = False) -> StartLightReading:
        threshold = self.threshold
        if self._is_ambient_unknown:
            status = Status.INVALID
        elif threshold <= (MIN_COUNTS if self._lamp_counts is None else self._lamp_counts):
            status = Status.UNCERTAIN
        else:
            status = Status.OK
        return StartLightReading(fired, self._ambient, threshold, status, refused, shorted)
