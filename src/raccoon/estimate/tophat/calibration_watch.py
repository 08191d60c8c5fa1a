"""Checks whether a calibration fits the present readings, within a second of driving."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from enum import StrEnum

from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP
from raccoon.estimate.tophat.calibration import TophatCalibration
from raccoon.estimate.tophat.quality import WANDERING_COUNTS
from raccoon.estimate.tophat.sensor import explain_levels

WINDOW_READINGS = 200  # readings: one second at 200 Hz
MIN_READINGS = 40  # least number of readings for a verdict
MIN_CHANGED_READINGS = 150
"""Least number of readings for a change of light: a robot that drives off half on a line reads neither
surface for up to 0.2 s."""
MAX_UNEXPLAINED_SHARE = 0.3  # of the readings, on neither surface: edges, lines along the path
SURFACE_SDS = 6.0  # standard deviations within which a reading belongs to a surface
MOVED_LEVEL_SHARE = 0.08  # of the contrast, by which a level may have moved
JUMP_WAY_M = 1.5e-3
"""m between two readings above which their difference is not counted: a sensor that moves to and fro over an
edge jumps as well."""


class Fit(StrEnum):
    """How well one sensor's readings fit its calibration."""

    UNKNOWN = "unknown"
    FITS = "fits"
    UNPLUGGED = "unplugged"
    """At the top of the converter, or jumping: nothing is connected."""
    SATURATED = "saturated"
    """At the bottom of the converter: more light than the sensor can measure."""
    CHANGED = "changed"
    """Neither surface explains the readings: other light, floor or height; calibrate again."""


class CalibrationWatch:
    """Watches one sensor: call `update` with every reading, then read `fit`."""

    def __init__(self, calibration: TophatCalibration) -> None:
        white, black = calibration.surfaces()
        slack = MOVED_LEVEL_SHARE * (black.mean - white.mean)
        self._white = (
            white.mean - SURFACE_SDS * white.sd - slack,
            white.mean + SURFACE_SDS * white.sd + slack,
        )
        self._black = (
            black.mean - SURFACE_SDS * black.sd - slack,
            black.mean + SURFACE_SDS * black.sd + slack,
        )
        self._readings: deque[float] = deque(maxlen=WINDOW_READINGS)
        self._steps: deque[float] = deque(maxlen=WINDOW_READINGS)

    def update(self, counts: float, way: float = 0.0) -> None:
        """Take a reading (counts). way: m that the sensor moved since the one before."""
        if self._readings and way < JUMP_WAY_M:
            self._steps.append(abs(counts - self._readings[-1]))
        self._readings.append(counts)

    @property
    def readings(self) -> tuple[float, ...]:
        """The readings of the last second, oldest first."""
        return tuple(self._readings)

    @property
    def fit(self) -> Fit:
        """The verdict on the readings of the last second."""
        readings = list(self._readings)
        if len(readings) < MIN_READINGS:
            return Fit.UNKNOWN
        ordered = sorted(readings)
        steps = sorted(self._steps)
        jumps = len(steps) >= MIN_READINGS and steps[len(steps) // 2] > WANDERING_COUNTS
        if jumps or ordered[len(ordered) // 10] >= ANALOG_TOP:
            return Fit.UNPLUGGED
        if ordered[-1 - len(ordered) // 10] <= ANALOG_BOTTOM:
            return Fit.SATURATED
        if len(readings) < MIN_CHANGED_READINGS:
            return Fit.UNKNOWN
        strange = sum(1 for each in readings if not self._is_explained(each))
        return Fit.CHANGED if strange > MAX_UNEXPLAINED_SHARE * len(readings) else Fit.FITS

    def _is_explained(self, counts: float) -> bool:
        return self._white[0] <= counts <= self._white[1] or self._black[0] <= counts <= self._black[1]


def has_height_changed(stored: TophatCalibration, now: TophatCalibration) -> bool:
    """Whether the sensor is higher or lower than at its calibration: its own light changed, not the ambient
    light.

    This needs two calibrations: a single level cannot distinguish height from light. False if no sensor that
    `explain_levels` knows reads the levels of one of them: then its height is unknown.
    """
    before, after = (
        {each.generation: each.height for each in explain_levels(white.mean, black.mean)}
        for white, black in (stored.surfaces(), now.surfaces())
    )
    shared = before.keys() & after.keys()
    if not (before and after):
        return False
    return not any(0.6 < after[generation] / before[generation] < 1.6 for generation in shared)


def find_swapped(
    stored: Mapping[str, TophatCalibration], floor: Mapping[str, Sequence[float]]
) -> tuple[str, str] | None:
    """The two sensors whose plugs are exchanged, or None.

    stored: calibrations by sensor. floor: readings on white by sensor. Two are swapped if each reads the
    other's white and neither its own.
    """
    levels = {name: sorted(readings)[len(readings) // 2] for name, readings in floor.items() if readings}
    names = sorted(levels.keys() & stored.keys())
    for index, one in enumerate(names):
        for other in names[index + 1 :]:
            crossed = _fits_white(stored[other], levels[one]) and _fits_white(stored[one], levels[other])
            if (
                crossed
                and not _fits_white(stored[one], levels[one])
                and not _fits_white(stored[other], levels[other])
            ):
                return one, other
    return None


def _fits_white(calibration: TophatCalibration, level: float) -> bool:
    white, black = calibration.surfaces()
    return abs(level - white.mean) <= SURFACE_SDS * white.sd + 0.5 * MOVED_LEVEL_SHARE * (
        black.mean - white.mean
    )
