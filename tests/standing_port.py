"""A port whose robot stands still, for tests of what is put around a port."""

from __future__ import annotations

from typing import Any

from raccoon.core.clock import SteppedClock
from raccoon.core.readings import SIMULATOR, Inputs, Outputs


class StandingPort:
    """Reads the same in every cycle of 5 ms. words: fields of its readings. clock: its own by default."""

    def __init__(self, clock: SteppedClock | None = None, **words: Any) -> None:
        self.clock = clock or SteppedClock(50.0)
        self.written: list[Outputs] = []
        self.closed = 0
        self._words = words

    def read(self) -> Inputs:
        self.clock.advance(0.005)
        return Inputs(time=self.clock.now(), device=SIMULATOR, **self._words)

    def write(self, outputs: Outputs) -> None:
        self.written.append(outputs)

    def close(self) -> None:
        self.closed += 1
