"""The plant one step at a time, for callers that choose the command of each step."""

from __future__ import annotations

import numpy as np

from raccoon.sim.plant.compiled import advance_one, given
from raccoon.sim.plant.quantities import Plant, State

_WHOLE = 1.0
"""Length of a cycle and bound on a step, s, longer than any step: a row of commands is then one cycle of one
step."""


class Steps:
    """Steps of a robot under commands that act at once, compiled if numba is installed.

    The caller models dead time and sampling pauses: those of the plant must be neutral (`latency` 0,
    `closed_share` 1). The samples and words of the plant's own controller are meaningless here.
    """

    def __init__(self) -> None:
        self._commands = tuple(given([0.0]) for _ in range(4))
        self._times = given([0.0, 0.0])
        self._noise = given([0.0]), given([0.0])
        self._kept = given(np.zeros(0, dtype=np.int64))
        self._out = np.zeros((0, 1))
        self._advance = advance_one()

    def after(
        self, state: State, plant: Plant, seconds: float, left: float | None, right: float | None
    ) -> State:
        """The state one step of `seconds` later. left, right: duty at the drivers, -1..1, forward positive;
        None: the motor coasts."""
        duty_left, duty_right, closed_left, closed_right = self._commands
        duty_left[0], closed_left[0] = (0.0, 0.0) if left is None else (left, 1.0)
        duty_right[0], closed_right[0] = (0.0, 0.0) if right is None else (right, 1.0)
        self._times[1] = seconds
        after: State = self._advance(
            state, plant, self._commands, self._times, 0, 1, _WHOLE, _WHOLE, (1.0, 1.0),
            self._noise, self._kept, self._out,
        )  # fmt: skip
        return after
