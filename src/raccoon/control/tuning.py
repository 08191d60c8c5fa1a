"""Gains of the wheel speed loop from the wheel's model, and their stability margins.

The loop from motor voltage to measured speed is a gain, the motor's first-order lag, the back-EMF filter's
lag and a dead time:

    G(s) = k / ((tau_m s + 1) (tau_f s + 1)) e^(-T s).

A PI controller whose zero cancels the motor's lag leaves L(s) = w_c / (s (tau_f s + 1)) e^(-T s) with w_c =
kp k / tau_m. So the phase margin at crossover is 90 deg - atan(w tau_f) - w T, and w_c is chosen for it.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from raccoon.control.feedforward import WheelModel
from raccoon.control.pid import PidGains


@dataclass(frozen=True, slots=True)
class Margins:
    """crossover: rad/s. phase: rad. gain: as a factor (inf if the phase never reaches -180 deg)."""

    crossover: float
    phase: float
    gain: float

    @property
    def gain_db(self) -> float:
        """The gain margin in dB."""
        return 20.0 * math.log10(self.gain)

    @property
    def delay(self) -> float:
        """s of additional dead time that the loop tolerates: phase margin over crossover frequency."""
        return self.phase / self.crossover if self.crossover > 0.0 else math.inf


def speed_loop_gains(
    wheel: WheelModel, filter_time_constant: float, dead_time: float, phase_margin: float = math.radians(65.0)
) -> PidGains:
    """PI gains (V per rad/s) that give `phase_margin` (rad) on the wheel's model.

    filter_time_constant: s, of the back-EMF filter. dead_time: s, from reading to effect.
    """
    crossover = _solve_crossover(filter_time_constant, dead_time, phase_margin)
    attenuation = math.hypot(1.0, crossover * filter_time_constant)
    kp = crossover * attenuation * wheel.time_constant / wheel.gain
    return PidGains(kp=kp, ki=kp / wheel.time_constant)


def margins(gains: PidGains, wheel: WheelModel, filter_time_constant: float, dead_time: float) -> Margins:
    """Phase and gain margin of the loop with `gains` on `wheel`, from its frequency response."""

    def response(frequency: float) -> complex:
        s = 1j * frequency
        controller = gains.kp + gains.ki / s + gains.kd * s / (gains.derivative_time_constant * s + 1.0)
        lags = (wheel.time_constant * s + 1.0) * (filter_time_constant * s + 1.0)
        return controller * wheel.gain * cmath.exp(-s * dead_time) / lags

    # Both crossings are searched on a fine logarithmic grid: the response is smooth and falls in between.
    grid = [10.0 ** (-1.0 + 4.5 * step / 4000.0) for step in range(4001)]
    crossover, phase_margin, gain_margin = 0.0, math.pi, math.inf
    last = response(grid[0])
    phase = cmath.phase(last)
    for frequency in grid[1:]:
        value = response(frequency)
        before, phase = phase, phase + cmath.phase(value / last)
        if abs(last) >= 1.0 > abs(value):
            crossover, phase_margin = frequency, math.pi + phase
        if before > -math.pi >= phase:
            gain_margin = min(gain_margin, 1.0 / abs(value))
        last = value
    return Margins(crossover, phase_margin, gain_margin)


class SlowCycleGains:
    """Reduction of a loop's gains if cycles take longer than they were designed for.

    For a given margin the crossover is about proportional to 1 / (dead time + lag). A cycle that is longer by
    d makes the command later by d, holds it for d / 2 longer on average, and its reading is the mean over d
    more: 2 d of dead time.

    cycle: s, nominal length of a cycle. late: s of dead time and lag that the gains were designed for.
    """

    SMOOTHING = 0.1
    """s, time constant: a single late cycle reduces the gains only little."""
    FORGIVEN = 1.5
    """Nominal cycles that a cycle may take without a reduction."""

    __slots__ = ("_cycle", "_late", "_usual")

    def __init__(self, cycle: float, late: float) -> None:
        self._usual = self._cycle = cycle
        self._late = late

    def share(self, dt: float) -> float:
        """Factor on the gains, 0..1, after a cycle of `dt` s."""
        self._cycle += (dt - self._cycle) * dt / (self.SMOOTHING + dt)
        longer = self._cycle - self.FORGIVEN * self._usual
        return 1.0 if longer <= 0.0 else self._late / (self._late + 2.0 * longer)


def _solve_crossover(lag: float, dead_time: float, phase_margin: float) -> float:
    """The w with w T + atan(w lag) = 90 deg - margin, by bisection (the left side is monotonic)."""
    target = math.pi / 2.0 - phase_margin
    low, high = 0.0, 1.0e4
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle * dead_time + math.atan(middle * lag) < target:
            low = middle
        else:
            high = middle
    return low
