"""Somebody beside the simulated robot: switches the lamp on, presses the button, holds paper under tophats.

A program that asks people for something before a match so runs in simulation as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

LAMP_DELAY_S = 2.0
"""s until the start light is switched on for a program that waits for it."""
PRESS_DELAY_S, PRESS_DURATION_S = 0.5, 0.2
"""s until the button is pressed for a program that waits for it, and until it is let go of."""


@dataclass(frozen=True, slots=True)
class _Lamp:
    off: float
    on: float
    since: float


class SimulatedBystander:
    """What is asked of them, and what a controller's words show of it; `time` is the simulation's, in s."""

    def __init__(self) -> None:
        self.time = 0.0
        self.black: bool | None = None
        """What all tophats are held over; None: the table."""
        self._lamps: dict[int, _Lamp] = {}
        self._press: float | None = None

    def hold_lamp(self, analog: int, off: float, on: float, *, lit: bool | None) -> None:
        """Have a start light over an analog port: lit from now on, not lit, or (None) after LAMP_AFTER."""
        since = self.time + LAMP_DELAY_S if lit is None else self.time if lit else math.inf
        self._lamps[analog] = _Lamp(off, on, since)

    def press_button(self) -> None:
        """Press the button after PRESS_AFTER, for PRESSED_FOR."""
        self._press = self.time + PRESS_DELAY_S

    @property
    def presses(self) -> bool:
        """Whether the button is to be pressed, or is."""
        return self._press is not None and self.time < self._press + PRESS_DURATION_S

    def put_over(self, black: bool | None) -> None:
        """Hold black or white under all tophats from now on; None: they see the table again."""
        self.black = black

    @property
    def button(self) -> bool | None:
        """Whether the button is pressed now; None where nobody ever asked for it."""
        return None if self._press is None else self.presses and self.time >= self._press

    def lit(self) -> dict[int, float]:
        """Counts on each analog port that has a light sensor, now."""
        return {port: lamp.on if self.time >= lamp.since else lamp.off for port, lamp in self._lamps.items()}
