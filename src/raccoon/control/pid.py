"""A PID loop with what a real motor requires: output limits, anti-windup and a filtered derivative."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PidGains:
    """Gains in units of output per unit of error.

    kp: output / unit. ki: output / (unit s). kd: output s / unit. derivative_time_constant: s, of the
    first-order filter on the derivative. All must be 0 or more.
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    derivative_time_constant: float = 0.02

    def __post_init__(self) -> None:
        for name in ("kp", "ki", "kd", "derivative_time_constant"):
            value = getattr(self, name)
            if not 0.0 <= value < float("inf"):
                raise ValueError(f"{name} is {value}: allowed are numbers from 0")


class Pid:
    """u = feedforward + kp e + I - kd d(measurement)/dt, limited to the range given with each step.

    The derivative is that of the measurement, so a step of the setpoint makes no jump. The integral changes
    only if that moves the output back towards its range (conditional integration), so it does not wind up.
    """

    __slots__ = ("_derivative", "_integral", "_last", "gains", "saturated")

    def __init__(self, gains: PidGains) -> None:
        self.gains = gains
        self.reset()

    @property
    def integral(self) -> float:
        """The integral term, in units of the output."""
        return self._integral

    def reset(self, integral: float = 0.0) -> None:
        """Forget the past; start with the given integral term."""
        self._integral = integral
        self._derivative = 0.0
        self._last: float | None = None
        self.saturated = 0
        """1 or -1 while the output is held at its upper or lower limit, else 0."""

    def step(
        self,
        setpoint: float,
        measurement: float,
        dt: float,
        feedforward: float,
        limit: float,
        share: float = 1.0,
    ) -> float:
        """The output after `dt` s, within -limit..limit. With dt 0 (a repeated reading) nothing is
        integrated.

        share: factor on the proportional and the integral gain in this step.
        """
        gains = self.gains
        error = share * (setpoint - measurement)
        if dt > 0.0:
            self._differentiate(measurement, dt)
        increment = gains.ki * error * dt
        wanted = feedforward + gains.kp * error + self._integral + increment - gains.kd * self._derivative
        output = max(-limit, min(limit, wanted))
        self.saturated = (wanted > limit) - (wanted < -limit)
        if self.saturated * increment <= 0.0:
            self._integral += increment
        return output

    def _differentiate(self, measurement: float, dt: float) -> None:
        if self._last is not None:
            rate = (measurement - self._last) / dt
            self._derivative += (rate - self._derivative) * dt / (self.gains.derivative_time_constant + dt)
        self._last = measurement
