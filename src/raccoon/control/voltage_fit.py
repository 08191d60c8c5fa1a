"""Fit of a wheel's voltage parameters to its voltage and speed: by the tuner once, by the watch always.

The motor equation in volts is linear in three parameters:

    U = S sign(w) + V w + A dw/dt,   S = R T_c / K_E,   V = K_E + R b / K_E,   A = R J / K_E.

Integrated over a window the derivative becomes a difference, so no noise is differentiated:

    sum U dt = S sum sign(w) dt + V sum w dt + A (w_end - w_begin).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Vector3 = tuple[float, float, float]
WINDOW_S = 0.05
"""s, length of a window over which voltage and speed are compared."""
MIN_SPEED = 0.4
"""rad/s; a slower wheel may stand."""
UNIT_ROWS: tuple[Vector3, Vector3, Vector3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
"""Rows that measure a single one of the three parameters."""


@dataclass(frozen=True, slots=True)
class WheelVoltages:
    """static: V. speed: V/(rad/s). acceleration: V/(rad/s2). Each with its standard deviation. residual:
    V."""

    static: float
    speed: float
    acceleration: float
    static_std: float
    speed_std: float
    acceleration_std: float
    residual: float


class Windows:
    """Sums of voltage, direction and time over windows of WINDOW_S s with constant direction.

    A window in which the wheel stands, reverses or has no reading holds no information and is dropped.
    """

    __slots__ = (
        "_direction",
        "_last_speed",
        "_seconds",
        "_start_speed",
        "_volt_seconds",
        "_way",
    )

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Start a new window."""
        self._seconds = self._volt_seconds = self._way = 0.0
        self._direction = 0.0
        self._start_speed = self._last_speed = 0.0

    def add(self, voltage: float, speed: float, dt: float) -> tuple[Vector3, float] | None:
        """Add a cycle of dt s with `voltage`, at whose end the wheel turns at `speed`; returns (row, V) of a
        full window."""
        direction = 0.0 if abs(speed) < MIN_SPEED else math.copysign(1.0, speed)
        if direction == 0.0 or dt <= 0.0 or (self._direction and direction != self._direction):
            self.clear()
            return None
        if not self._direction:
            self._direction, self._start_speed, self._last_speed = direction, speed, speed
            return None
        self._seconds += dt
        self._volt_seconds += voltage * dt
        self._way += 0.5 * (speed + self._last_speed) * dt
        self._last_speed = speed
        if self._seconds < WINDOW_S:
            return None
        t = self._seconds
        row = (direction, self._way / t, (speed - self._start_speed) / t)
        volts = self._volt_seconds / t
        self.clear()
        self._direction, self._start_speed, self._last_speed = direction, speed, speed
        return row, volts


class RecursiveFit:
    """Recursive least squares of three parameters with a prior and slow forgetting.

    prior: values. spread: their prior standard deviations. noise: V of one row. memory: rows in memory.
    """

    __slots__ = ("_forgetting", "_prior", "_variance", "covariance", "rows", "values")

    def __init__(self, prior: Vector3, spread: Vector3, noise: float, memory: float = math.inf) -> None:
        self._prior = (prior, spread)
        self._variance = noise * noise
        self._forgetting = 1.0 - 1.0 / memory
        self.values = list(prior)
        self.covariance = [[spread[i] ** 2 if i == j else 0.0 for j in range(3)] for i in range(3)]
        self.rows = 0

    def add(self, row: Vector3, volts: float, doubt: float = 0.0) -> float:
        """Take a row; returns its residual, V. doubt: V, standard deviation of this row besides the noise."""
        off = self._update(row, volts, self._variance + doubt * doubt)
        if self._forgetting < 1.0:
            self._forget()
        self.rows += 1
        return off

    def _update(self, row: Vector3, value: float, variance: float) -> float:
        """Update with a linear combination of the three parameters and its variance; returns the residual."""
        P = self.covariance
        gain = [sum(P[i][j] * row[j] for j in range(3)) for i in range(3)]
        total = variance + sum(row[i] * gain[i] for i in range(3))
        off = value - sum(row[i] * self.values[i] for i in range(3))
        for i in range(3):
            self.values[i] += gain[i] / total * off
            for j in range(i, 3):  # forgetting would amplify any asymmetry
                P[i][j] = P[j][i] = P[i][j] - gain[i] * gain[j] / total
        return off

    def _forget(self) -> None:
        """Reduce the weight of the data, but not that of the prior. Otherwise the combinations that the rows
        do not determine (a wheel at constant speed determines only one sum of friction and speed) would drift
        with every row."""
        for each in self.covariance:
            each[:] = [value / self._forgetting for value in each]
        for row, value, spread in zip(UNIT_ROWS, *self._prior, strict=True):
            self._update(row, value, spread * spread / (1.0 - self._forgetting))

    def std(self, index: int) -> float:
        """Standard deviation of a value."""
        return math.sqrt(max(0.0, self.covariance[index][index]))


def fit_voltages(rows: list[tuple[Vector3, float]]) -> WheelVoltages:
    """Ordinary least squares of many windows. Raises ValueError if they do not determine all three
    parameters."""
    import numpy as np

    if len(rows) < 6:
        raise ValueError(f"{len(rows)} windows of steady motion: at least 6 are needed")
    matrix = np.array([row for row, _ in rows])
    volts = np.array([each for _, each in rows])
    scaled = matrix / np.maximum(np.abs(matrix).max(axis=0), 1e-9)
    if np.linalg.matrix_rank(matrix) < 3 or np.linalg.cond(scaled) > 100.0:
        raise ValueError("the speeds are too much alike to tell friction, speed and inertia apart")
    values = np.linalg.lstsq(matrix, volts, rcond=None)[0]
    off = volts - matrix @ values
    residual = float(np.sqrt(off @ off / max(1, len(rows) - 3)))
    std = residual * np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))
    static, speed, acceleration = (float(each) for each in values)
    static_std, speed_std, acceleration_std = (float(each) for each in std)
    return WheelVoltages(static, speed, acceleration, static_std, speed_std, acceleration_std, residual)
