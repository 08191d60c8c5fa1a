"""Detection of a battery so low that the controller may restart."""

from __future__ import annotations


class BatteryWatch:
    """Watches the smoothed voltage, as starting motors pull the battery down for a moment.

    held: V by which a rising voltage may be above its reading. The filter of the stock firmware truncates, so
    after a load its reading stays that low. A reading that fell last is exact; one that rose last is `held`
    below the voltage.
    """

    LOWEST = 5.7
    """V. The stock firmware switches its warning light on at 5.64 V, and does nothing else."""
    RECOVERED = 5.9
    TIME_CONSTANT = 0.2

    def __init__(self, held: float = 0.0) -> None:
        self._held = held
        self._missing = 0.0
        self._last = self._time = 0.0
        self._low = False
        self.voltage: float | None = None
        """V, smoothed; None before the first reading."""

    def update(self, voltage: float, time: float) -> bool:
        """Whether the smoothed voltage is too low: below `LOWEST`, then until it is above `RECOVERED`."""
        if self.voltage is None:
            self.voltage = voltage
        else:
            if voltage != self._last:
                self._missing = self._held if voltage > self._last else 0.0
            share = min((time - self._time) / self.TIME_CONSTANT, 1.0)
            self.voltage += share * (voltage + self._missing - self.voltage)
        self._last, self._time = voltage, time
        self._low = self.voltage < (self.RECOVERED if self._low else self.LOWEST)
        return self._low
