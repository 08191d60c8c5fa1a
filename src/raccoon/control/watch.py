"""Is a motor still the one the controller was tuned for? Stall, unplugged, weak magnet, high resistance."""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.control.feedforward import WheelModel
from raccoon.control.identify import RecursiveFit, Windows

STALL_SPEED_SHARE = 0.2
"""Of the speed this voltage gives a nominal wheel; the slowest of the paper's motors reaches far more."""
STALL_TIME = 0.35
"""s of it: longer than breaking loose takes at the least voltage that does it."""
STALL_OVERDRIVE = 0.8
"""V beyond what friction takes before silence means anything."""
ODD_SHARE = 0.25
"""A motor that takes this much more or less than its model is reported."""


@dataclass(frozen=True, slots=True)
class WheelState:
    """What the watch thinks of one wheel.

    stalled: driven and not moving. oddity: what differs from the model, "" where nothing does.
    speed_factor, load_factor: present over nominal V a rad/s (K_E) and V a N m (R / K_E), with their
    standard deviations.
    """

    stalled: bool
    oddity: str
    speed_factor: float
    speed_factor_std: float
    load_factor: float
    load_factor_std: float


class WheelWatch:
    """Watches one wheel. Feed it every cycle in which the motor is driven.

    Half the K_E shows as half the V a rad/s where the speed is known otherwise; as the counter of such a
    motor lies by the same factor, it shows as twice the friction and inertia voltage instead. Half as much
    resistance again shows as half as much more of both.
    """

    __slots__ = ("_fit", "_model", "_silent", "_windows", "stalled")

    def __init__(self, model: WheelModel) -> None:
        self._model = model
        self._windows = Windows()
        nominal = (model.static_voltage, 1.0 / model.gain, model.acceleration_voltage)
        # Friction may differ by all of itself, the V a rad/s is calibrated, the inertia is a guess.
        spread = (0.8 * nominal[0] + 0.1, 0.3 * nominal[1], 0.8 * nominal[2])
        self._fit = RecursiveFit(nominal, spread, noise=0.12, memory=120.0)
        self._silent = 0.0
        self.stalled = False

    def update(self, voltage: float, speed: float | None, dt: float) -> None:
        """A cycle of dt s under `voltage` V; `speed` rad/s at its end, None where there is no reading."""
        if speed is None:
            self._windows.clear()
            return
        spare = abs(voltage) - self._model.static_voltage
        moves = abs(speed) >= STALL_SPEED_SHARE * max(0.0, spare) * self._model.gain
        driven = spare > STALL_OVERDRIVE
        self._silent = 0.0 if moves or not driven else self._silent + dt
        self.stalled = self._silent > STALL_TIME
        found = self._windows.add(voltage, speed, dt)
        if found is not None:
            self._fit.add(*found)

    def rest(self) -> None:
        """The motor is off: nothing is learnt."""
        self._windows.clear()
        self._silent = 0.0
        self.stalled = False

    @property
    def state(self) -> WheelState:
        """The present verdict."""
        fit, model = self._fit, self._model
        speed, speed_std = fit.values[1] * model.gain, fit.std(1) * model.gain
        load = fit.values[2] / model.acceleration_voltage
        load_std = fit.std(2) / model.acceleration_voltage
        return WheelState(
            self.stalled, self._oddity(speed, speed_std, load, load_std), speed, speed_std, load, load_std
        )

    def _oddity(self, speed: float, speed_std: float, load: float, load_std: float) -> str:
        if self._fit.rows < 12:
            return ""
        if abs(speed - 1.0) > max(ODD_SHARE, 4.0 * speed_std):
            return f"takes {speed:.2f} times the voltage a speed should: magnet (K_E) or calibration"
        if abs(load - 1.0) > max(ODD_SHARE, 3.0 * load_std) and math.isfinite(load):
            return f"takes {load:.2f} times the voltage a load should: resistance, magnet or weight"
        return ""
