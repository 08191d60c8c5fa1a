"""What the battery gives now, out of a noisy converter reading."""

from __future__ import annotations

from dataclasses import dataclass

from raccoon.core.readings import Status
from raccoon.core.schema import BATTERY_VOLTAGE

LEAST, MOST = BATTERY_VOLTAGE.low, BATTERY_VOLTAGE.high
"""V between which a reading is a battery's."""
TIME_CONSTANT = 0.1
"""s; long enough for the converter's steps of 9 mV, short enough to follow sag."""
READING_STD = 0.02
"""V, of one reading."""
LOWEST = 5.6
"""V; below it the controller itself is about to brown out."""


@dataclass(frozen=True, slots=True)
class BatteryEstimate:
    """voltage V under the present load with its standard deviation; status invalid before any reading."""

    voltage: float
    std: float
    status: Status


class BatteryVoltage:
    """First-order filter of the voltage under load."""

    __slots__ = ("_time", "_value", "_variance")

    def __init__(self) -> None:
        self._time: float | None = None
        self._value = 0.0
        self._variance = READING_STD * READING_STD

    def update(self, time: float, voltage: float | None) -> None:
        """Take the reading of this cycle; None and voltages that no controller runs on are passed over.

        Of a converter that dies the filter would otherwise come through every voltage on its way down.
        """
        if voltage is None or not LEAST <= voltage <= MOST:
            return
        if self._time is None:
            self._value = voltage
        else:
            dt = time - self._time
            share = min(1.0, max(0.0, dt) / TIME_CONSTANT)
            self._value += share * (voltage - self._value)
            noise = READING_STD * READING_STD
            self._variance = (1.0 - share) ** 2 * self._variance + share * share * noise
        self._time = time

    @property
    def voltage(self) -> float | None:
        """V, None before the first reading."""
        return None if self._time is None else self._value

    def estimate(self) -> BatteryEstimate:
        """Value, standard deviation and status."""
        if self._time is None:
            return BatteryEstimate(0.0, float("inf"), Status.INVALID)
        status = Status.OK if self._value > LOWEST else Status.UNCERTAIN
        return BatteryEstimate(self._value, self._variance**0.5, status)
