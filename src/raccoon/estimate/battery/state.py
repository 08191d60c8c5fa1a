"""State of charge and internal resistance of the pack, estimated in operation from its voltage sag.

U = U_0 - R_i I: the voltage under load is linear in the current. Voltage and current, both averaged over the
same 0.1 s, feed a recursive least-squares fit of U_0 and R_i with a memory of a minute, so that U_0 follows
the discharge. U_0 over the number of cells gives the charge on the chemistry's curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.core.readings import Status
from raccoon.estimate.battery.curves import charge_at
from raccoon.estimate.battery.voltage import MAX_VOLTAGE, MIN_VOLTAGE

WINDOW_S = 0.1
"""s over which voltage and current are averaged."""
SETTLE_S = 0.15
"""s after a change of current until the filtered voltage has settled."""
MEMORY_WINDOWS = 600.0
"""Number of windows in memory: a minute."""
MIN_SWING = 0.15
"""A, least range of the current for a reliable resistance."""


@dataclass(frozen=True, slots=True)
class PackEstimate:
    """Estimate of the pack, each value with one standard deviation.

    open_circuit_voltage V · internal_resistance ohm · charge 0..1. status: invalid before any reading,
    uncertain until the load has varied enough to show the resistance.
    """

    open_circuit_voltage: float
    open_circuit_voltage_std: float
    internal_resistance: float
    internal_resistance_std: float
    charge: float
    charge_std: float
    status: Status

    def __str__(self) -> str:
        """Readable text: each value with its standard deviation."""
        voltage = f"{self.open_circuit_voltage:.2f} V (+- {self.open_circuit_voltage_std:.2f})"
        resistance = f"{self.internal_resistance:.3f} ohm (+- {self.internal_resistance_std:.3f})"
        charge = f"{100.0 * self.charge:.0f} % (+- {100.0 * self.charge_std:.0f})"
        return f"charge {charge}, open-circuit {voltage}, internal {resistance}, {self.status}"


class PackState:
    """Estimator of the pack. Call `update` in every cycle.

    chemistry: "lifepo4", "lipo" or "nimh". cells: in series. resistance, resistance_std: ohm, prior.
    reading_std: V, of the mean of a window.
    """

    def __init__(
        self,
        chemistry: str = "lifepo4",
        cells: float = 2.0,
        resistance: float = 0.08,
        resistance_std: float = 0.06,
        reading_std: float = 0.004,
    ) -> None:
        if not cells >= 1.0:
            raise ValueError(f"cells is {cells}: it must be 1 or more")
        charge_at(chemistry, 1.0)  # raises for an unknown chemistry
        self._chemistry, self._cells = chemistry, cells
        self._variance = reading_std * reading_std
        self._open_circuit_voltage, self._resistance = 0.0, resistance
        self._covariance = [[25.0, 0.0], [0.0, resistance_std * resistance_std]]
        self._time: float | None = None
        self._current = self._window_seconds = self._volt_seconds = self._ampere_seconds = 0.0
        self._steady_seconds = 0.0
        self._least, self._most = math.inf, -math.inf
        self._windows = 0

    def update(self, time: float, voltage: float | None, current: float) -> None:
        """Take a cycle at `time` s: battery voltage (V) as read, and the estimated current of the motors
        (A)."""
        last, self._time = self._time, time
        if (
            voltage is None
            or not MIN_VOLTAGE <= voltage <= MAX_VOLTAGE
            or not math.isfinite(current)
            or last is None
        ):
            return
        dt = time - last
        if abs(current - self._current) > 0.1:
            self._steady_seconds = self._window_seconds = self._volt_seconds = self._ampere_seconds = 0.0
            self._current = current
        self._steady_seconds += dt
        if dt <= 0.0 or self._steady_seconds < SETTLE_S:
            return
        self._window_seconds += dt
        self._volt_seconds += voltage * dt
        self._ampere_seconds += current * dt
        if self._window_seconds >= WINDOW_S:
            self._update_fit(
                self._volt_seconds / self._window_seconds, self._ampere_seconds / self._window_seconds
            )
            self._window_seconds = self._volt_seconds = self._ampere_seconds = 0.0

    def _update_fit(self, voltage: float, current: float) -> None:
        if not self._windows:
            self._open_circuit_voltage = voltage + self._resistance * current
        self._windows += 1
        self._least, self._most = min(self._least, current), max(self._most, current)
        (a, b), (_, d) = self._covariance
        a *= 1.0 + 1.0 / MEMORY_WINDOWS  # the open-circuit voltage drifts, the resistance hardly does
        gain = (a - b * current, b - d * current)
        total = self._variance + gain[0] - gain[1] * current
        off = voltage - (self._open_circuit_voltage - self._resistance * current)
        self._open_circuit_voltage += gain[0] / total * off
        self._resistance = max(0.0, self._resistance + gain[1] / total * off)
        b -= gain[0] * gain[1] / total
        self._covariance = [[a - gain[0] ** 2 / total, b], [b, d - gain[1] ** 2 / total]]

    @property
    def estimate(self) -> PackEstimate:
        """The present estimate."""
        if not self._windows:
            return PackEstimate(0.0, math.inf, self._resistance, math.inf, 0.0, math.inf, Status.INVALID)
        std = math.sqrt(max(self._covariance[0][0], 0.0))
        cell, cell_std = self._open_circuit_voltage / self._cells, (std + 0.02) / self._cells
        charge = charge_at(self._chemistry, cell)
        high = charge_at(self._chemistry, cell + cell_std)
        low = charge_at(self._chemistry, cell - cell_std)
        swung = self._most - self._least > MIN_SWING
        return PackEstimate(
            self._open_circuit_voltage,
            std,
            self._resistance,
            math.sqrt(max(self._covariance[1][1], 0.0)),
            charge,
            max(0.02, 0.5 * (high - low)),
            Status.OK if swung else Status.UNCERTAIN,
        )
