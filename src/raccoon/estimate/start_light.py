"""The start light: fires once when the lamp over the sensor goes on, and on nothing else.

A light sensor reads lower in more light. Before the start the detector learns how bright it has been and how
much that moves. The lamp is a fall well below both which is quick and stays. What only looks like it is not
all three: a camera flash does not stay, a shadow that leaves falls no lower than the light was before it
came, the sun comes slowly (and is learnt).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from raccoon.core.errors import CalibrationError, ConfigError, MotionTimeout
from raccoon.core.readings import Status

LEARNING_SECONDS = 0.5  # of ambient light before anything may fire
AMBIENT_SECONDS = 0.5  # time constant of the ambient level
MEMORY_SECONDS = 60.0  # time constant in which a brighter past is forgotten
LEAST_FALL = 0.35  # of the ambient reading, where the lamp is not calibrated
LEAST_COUNTS = 60.0  # between ambient and threshold
LEAST_SD = 8.0  # noise standard deviations between ambient and threshold
LEAST_RATIO = 0.75  # lamp on over lamp off, above which a calibration is refused
QUICK = 1.8  # light over the least light just before, above which a lamp went on
STEADY = 1.2  # light over the light three readings before, below which a lamp is fully on
FULL_SCALE = 4095.0


@dataclass(frozen=True, slots=True)
class StartLightCalibration:
    """What the sensor reads with the lamp off and on, counts (on is the lower)."""

    off: float
    on: float


class StartLightReading(NamedTuple):
    """fired: the lamp went on (stays True; in a rehearsal True for one reading).

    ambient, threshold: counts. status: `invalid` while the ambient light is being learnt, `uncertain` where
    it is so bright that the lamp could not be told from it.
    """

    fired: bool
    ambient: float
    threshold: float
    status: Status


def calibrate_start_light(off: Sequence[float], on: Sequence[float]) -> StartLightCalibration:
    """Levels from readings with the lamp off and then on; the median of each, at least 10 readings.

    Raises ConfigError for readings that are not counts, CalibrationError where the lamp makes no difference.
    """
    for name, counts in (("off", off), ("on", on)):
        if len(counts) < 10:
            raise CalibrationError(f"{len(counts)} readings with the lamp {name}: at least 10 are needed")
        wrong = [each for each in counts if not 0.0 <= each <= FULL_SCALE]
        if wrong:
            raise ConfigError(f"reading {wrong[0]} with the lamp {name}: allowed are counts from 0 to 4095")
    dark, lit = (float(sorted(counts)[len(counts) // 2]) for counts in (off, on))
    if lit > LEAST_RATIO * dark or dark - lit < LEAST_COUNTS:
        raise CalibrationError(
            f"{dark:.0f} counts with the lamp off and {lit:.0f} with it on: shade the sensor from other light"
        )
    return StartLightCalibration(dark, lit)


class StartLight:
    """Detector of one start light. Feed it every reading until it fires.

    calibration: lamp levels; without one the fall must be at least 35 % of the reading. hold: s that the
    light must stay. rise: s within which it must come. rehearsal: fire again each time the lamp comes on
    (test mode).

    Raises ConfigError for a hold or rise that is not above 0.
    """

    def __init__(
        self,
        calibration: StartLightCalibration | None = None,
        *,
        hold: float = 0.038,
        rise: float = 0.030,
        rehearsal: bool = False,
    ) -> None:
        if not (hold > 0.0 and rise > 0.0):
            raise ConfigError(f"hold = {hold} s, rise = {rise} s: allowed are numbers above 0")
        self._lamp = None if calibration is None else calibration.on
        self._hold, self._rise, self._rehearsal = hold, rise, rehearsal
        self._ambient = self._brightest = math.nan
        self._variance = 25.0
        self._learning: list[float] = []
        self._first = self._last = math.nan
        self._recent: deque[tuple[float, float]] = deque()  # (time, counts) of the last hold + rise seconds
        self._since: float | None = None  # when the candidate began
        self._slow = False  # the fall was no lamp's: wait until it is over or learnt
        self.fired = False
        self.fires = 0

    def update(self, time: float, counts: float | None) -> StartLightReading:
        """Take the reading of this tick (s, counts; None: nothing new)."""
        if counts is None or (self.fired and not self._rehearsal):
            return self._reading(fired=self.fired and not self._rehearsal)
        if math.isnan(self._first):
            self._first = self._last = time
        dt, self._last = time - self._last, time
        threshold = self.threshold
        if time - self._first < LEARNING_SECONDS:
            self._begin(counts)
            return self._reading(fired=False)
        self._remember(time, counts)
        if counts > threshold:
            self._since, self._slow = None, False
            self._learn(counts, dt)
            return self._reading(fired=False)
        return self._reading(fired=self._candidate(time, counts, dt))

    @property
    def threshold(self) -> float:
        """Counts below which it is brighter than any ambient light so far."""
        if math.isnan(self._brightest):
            return 0.0
        clear = max(LEAST_COUNTS, LEAST_SD * math.sqrt(self._variance))
        if self._lamp is None:
            return min((1.0 - LEAST_FALL) * self._brightest, self._brightest - clear)
        return min(math.sqrt(max(self._lamp, 1.0) * max(self._brightest, 1.0)), self._brightest - clear)

    def _candidate(self, time: float, counts: float, dt: float) -> bool:
        if self._since is None:
            self._since = time
        if self._slow:
            self._learn(counts, dt)
            return False
        if time - self._since < self._hold - 1e-6:
            return False
        light = _light(counts)
        before = _light(max(each for _, each in self._recent))
        quick = light > QUICK * before and light < STEADY * _light(self._recent[-4][1])
        if not quick:
            # It may be a lamp that is still warming up, but not for long.
            self._slow = time - self._since > self._hold + self._rise
            return False
        if self._rehearsal:
            self._slow = True  # fires once until the lamp is off again
        self.fired = True
        self.fires += 1
        return True

    def _begin(self, counts: float) -> None:
        """Ambient level and noise from the median so far: a flash while learning must not pass for either."""
        self._learning.append(counts)
        ordered = sorted(self._learning)
        self._ambient = self._brightest = ordered[len(ordered) // 2]
        steps = sorted(abs(after - before) for before, after in pairwise(self._learning))
        if steps:
            self._variance = steps[len(steps) // 2] ** 2 + 9.0  # the median step of noise is 0.95 sd

    def _remember(self, time: float, counts: float) -> None:
        self._recent.append((time, counts))
        while len(self._recent) > 4 and self._recent[0][0] < time - self._hold - self._rise:
            self._recent.popleft()

    def _learn(self, counts: float, dt: float) -> None:
        share = min(dt / AMBIENT_SECONDS, 1.0)
        self._ambient += share * (counts - self._ambient)
        # From one reading to the next: a level that moves is no noise.
        step = counts - self._recent[-2][1] if len(self._recent) > 1 else 0.0
        self._variance += 0.3 * share * (min(0.5 * step * step, 9.0 * self._variance) - self._variance)
        self._brightest += min(dt / MEMORY_SECONDS, 1.0) * (self._ambient - self._brightest)
        self._brightest = min(self._brightest, self._ambient)

    def _reading(self, *, fired: bool) -> StartLightReading:
        if math.isnan(self._first) or self._last - self._first < LEARNING_SECONDS:
            status = Status.INVALID
        elif self.threshold <= (LEAST_COUNTS if self._lamp is None else self._lamp):
            status = Status.UNCERTAIN
        else:
            status = Status.OK
        return StartLightReading(fired, self._ambient, self.threshold, status)


def _light(counts: float) -> float:
    """Light on the sensor in units of the light that halves its reading (raccoon.model.reflectance)."""
    return FULL_SCALE / max(counts, 1.0) - 1.0


def wait_for_light(
    read: Callable[[], tuple[float, float | None]], light: StartLight, timeout: float | None = None
) -> float:
    """Read until the lamp goes on; the time (s) at which that was sure.

    read: gives (time, counts) of the next cycle. Raises MotionTimeout after `timeout` s.
    """
    time, counts = read()
    start = time
    while not light.update(time, counts).fired:
        if timeout is not None and time - start >= timeout:
            raise MotionTimeout(f"no start light in {timeout} s; the sensor reads {counts} counts")
        time, counts = read()
    return time
