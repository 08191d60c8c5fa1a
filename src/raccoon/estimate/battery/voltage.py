"""Battery voltage under load, filtered from a noisy converter reading."""

from __future__ import annotations

from raccoon.core.schema import BATTERY_VOLTAGE

MIN_VOLTAGE, MAX_VOLTAGE = BATTERY_VOLTAGE.low, BATTERY_VOLTAGE.high
"""V, bounds on a plausible battery reading."""
TIME_CONSTANT_S = 0.1
"""s; long enough for the converter's steps of 9 mV, short enough to follow sag."""


class BatteryVoltage:
    """First-order filter of the voltage under load."""

    __slots__ = ("_time", "_value")

    def __init__(self) -> None:
        self._time: float | None = None
        self._value = 0.0

    def update(self, time: float, voltage: float | None) -> None:
        """Take the reading of this cycle; None and voltages that no controller runs on are ignored.

        Otherwise the filter would follow the voltage of a failing converter down to 0.
        """
        if voltage is None or not MIN_VOLTAGE <= voltage <= MAX_VOLTAGE:
            return
        if self._time is None:
            self._value = voltage
        else:
            share = min(1.0, max(0.0, time - self._time) / TIME_CONSTANT_S)
            self._value += share * (voltage - self._value)
        self._time = time

    @property
    def voltage(self) -> float | None:
        """V; None before the first reading."""
        return None if self._time is None else self._value
