"""Calibration of the start light: the sensor's readings with the lamp off and on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from raccoon.core.errors import CalibrationError, ConfigError
from raccoon.core.readings import ANALOG_BOTTOM
from raccoon.model.reflectance import FULL_SCALE, light_of

MIN_COUNTS = 60.0
"""Least difference in counts between lamp off and on, and between the ambient light and the threshold."""
MIN_RATIO = 0.75  # lamp on over lamp off, above which a calibration is refused
MIN_LIGHT_RATIO = 1.6  # light with the lamp over light without it, below which a calibration is refused


@dataclass(frozen=True, slots=True)
class StartLightCalibration:
    """Readings with the lamp off and on, counts (on is the lower one).

    Raises ConfigError for other values: exchanged, darkness would pass for the lamp.
    """

    off: float
    on: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.on < self.off <= FULL_SCALE:
            raise ConfigError(
                f"start light: off is {self.off}, on is {self.on}: allowed are counts from 0 to "
                f"{FULL_SCALE:g}, on below off"
            )


def calibrate_start_light(off: Sequence[float], on: Sequence[float]) -> StartLightCalibration:
    """Levels from readings with the lamp off and then on; the median of each, at least 10 readings.

    Raises ConfigError for readings that are not counts, CalibrationError if the lamp makes no difference or
    the sensor reads the bottom of the scale, as with wires that touch.
    """
    for name, counts in (("off", off), ("on", on)):
        if len(counts) < 10:
            raise CalibrationError(f"{len(counts)} readings with the lamp {name}: at least 10 are needed")
        wrong = [each for each in counts if not 0.0 <= each <= FULL_SCALE]
        if wrong:
            raise ConfigError(f"reading {wrong[0]} with the lamp {name}: allowed are counts from 0 to 4095")
    dark, lit = (float(sorted(counts)[len(counts) // 2]) for counts in (off, on))
    if lit <= ANALOG_BOTTOM:
        raise CalibrationError(
            f"{lit:.0f} counts with the lamp on: no lamp is so bright; check for wires that touch, and for "
            "a plug that is reversed or one hole off"
        )
    plain = light_of(lit) >= MIN_LIGHT_RATIO * light_of(dark)
    if lit > MIN_RATIO * dark or dark - lit < MIN_COUNTS or not plain:
        raise CalibrationError(
            f"{dark:.0f} counts with the lamp off and {lit:.0f} with it on: shade the sensor from other light"
        )
    return StartLightCalibration(dark, lit)
