"""Voltage scaling: the same motor voltage from every battery, as far as the battery can supply it.

The paper's factor is k = U_reference / U_measured. A command of 100 % cannot be scaled up on a weaker
battery; the missing share is reported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.control.feedforward import WheelModel

MIN_VOLTAGE = 3.0
"""V; a lower reading is not a battery's (a dead converter reads 0): the previous or nominal voltage is used
instead."""


@dataclass(frozen=True, slots=True)
class ScaledDuty:
    """A scaled command.

    duty: -1..1 for the motor. factor: k. missing: share of the wanted voltage that the battery cannot supply,
    or 0.
    """

    duty: float
    factor: float
    missing: float

    @property
    def saturated(self) -> bool:
        """Whether the battery cannot supply the wanted voltage."""
        return self.missing > 0.0


class VoltageScaling:
    """Scales duties that were tuned at `reference` V to the present battery voltage.

    reference: V, best the highest battery voltage that will be used. Raises ValueError below 3 V.
    """

    __slots__ = ("reference",)

    def __init__(self, reference: float) -> None:
        if not MIN_VOLTAGE < reference < math.inf:
            raise ValueError(f"reference is {reference} V: it must be above {MIN_VOLTAGE} V")
        self.reference = reference

    def scale_duty(self, duty: float, battery_voltage: float | None) -> ScaledDuty:
        """`duty` (-1..1), tuned for the reference battery, on one of `battery_voltage` V.

        None or an impossible voltage scales by 1.
        """
        if not -1.0 <= duty <= 1.0:
            raise ValueError(f"duty is {duty}: allowed are numbers from -1 to 1")
        usable = battery_voltage is not None and MIN_VOLTAGE < battery_voltage < math.inf
        factor = self.reference / battery_voltage if usable and battery_voltage is not None else 1.0
        wanted = duty * factor
        given = max(-1.0, min(1.0, wanted))
        return ScaledDuty(given, factor, 0.0 if given == wanted else 1.0 - given / wanted)


@dataclass(frozen=True, slots=True)
class SpeedBudget:
    """Battery assumptions for planning a match so that it runs the same on a fresh and on the weakest
    battery.

    weakest: V without load, of the emptiest battery of the match. internal_resistance: ohm of the pack.
    reserve: share of the voltage that is kept for the speed loop.
    """

    weakest: float
    internal_resistance: float = 0.05
    reserve: float = 0.05

    def top_wheel_speed(self, wheel: WheelModel, acceleration: float = 0.0) -> float:
        """rad/s that `wheel`, and another one like it, can reach while still accelerating by `acceleration`
        rad/s2.

        At the motor: U = (weakest - 2 R_i I) (1 - reserve), and U = K_E w + R I with I = (J a + b w + T_c) /
        K_E. Solved for w; 0 if it cannot move at all.
        """
        share = 1.0 - self.reserve
        constant, drop = wheel.back_emf_constant, 2.0 * self.internal_resistance * share
        held = (wheel.inertia * abs(acceleration) + wheel.coulomb) / constant
        slope = constant + (wheel.resistance + drop) * wheel.viscous / constant
        return max(0.0, (self.weakest * share - (wheel.resistance + drop) * held) / slope)
