"""The bystander of a simulated robot: switches the lamp on, presses the button, holds paper under the
tophats.

A program that asks people for something before a match thus runs unchanged in simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

LAMP_DELAY_S = 2.0
"""s until the start light is switched on for a program that waits for it."""
PRESS_DELAY_S, PRESS_DURATION_S = 0.5, 0.2
"""s until the button is pressed for a program that waits for it, and s until it is released."""


@dataclass(frozen=True, slots=True)
class _Lamp:
    off: float
    on: float
    since: float


class SimulatedBystander:
    """The requests to the bystander, and their effect on the controller's words. time: of the simulation,
    s."""

    def __init__(self) -> None:
        self.time = 0.0
        self.black: bool | None = None
        """What is held under all tophats; None: they see the table."""
        self._lamps: dict[int, _Lamp] = {}
        self._press: float | None = None

    def hold_lamp(self, analog: int, off: float, on: float, *, lit: bool | None) -> None:
        """Hold a start light over an analog port: on, off, or (None) switched on after LAMP_DELAY_S."""
        since = self.time + LAMP_DELAY_S if lit is None else self.time if lit else math.inf
        self._lamps[analog] = _Lamp(off, on, since)

    def press_button(self) -> None:
        """Press the button after PRESS_DELAY_S, for PRESS_DURATION_S."""
        self._press = self.time + PRESS_DELAY_S

    @property
    def presses(self) -> bool:
        """Whether the button will be pressed, or is."""
        return self._press is not None and self.time < self._press + PRESS_DURATION_S

    def put_over(self, black: bool | None) -> None:
        """Hold black or white under all tophats from now on; None: they see the table again."""
        self.black = black

    @property
    def button(self) -> bool | None:
        """Whether the button is pressed now; None if nobody ever asked for it."""
        return None if self._press is None else self.presses and self.time >= self._press

    def lit(self) -> dict[int, float]:
        """Present counts on each analog port that has a light sensor."""
        return {port: lamp.on if self.time >= lamp.since else lamp.off for port, lamp in self._lamps.items()}
