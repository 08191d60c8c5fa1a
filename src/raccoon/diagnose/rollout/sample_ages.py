"""How old the wheels' samples are that a row has, of a controller whose cycle is not the row's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.hypotheses.base_coordinates import SAMPLE_PHASE_STD
from raccoon.diagnose.hypotheses.coordinates import Coordinate, Setting, Settings
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

SAMPLE_AGE: dict[str, Setting] = {side: ("sample", side, "age") for side in SIDES}
"""s by which a side's are older than the chain has them."""
MAX_PHASE_STDS = 1.75
"""Of `SAMPLE_PHASE_STD`: half a cycle, from the middle of one to its ends."""


def age_settings() -> Settings:
    """As old as the chain has them."""
    return dict.fromkeys(SAMPLE_AGE.values(), 0.0)


def age_coordinates() -> tuple[Coordinate, ...]:
    """Each motor is sampled in a moment of its own. A clock that drifts is in the middle on average; one that
    is in step with the rows may stay anywhere, and a filter of another time constant does not make up for
    it where wheels speed up: a gear that loses torque, or a slip, of sound robots."""
    return tuple(
        Coordinate(
            "sample.age", (each,), lambda u: SAMPLE_PHASE_STD * u, low=-MAX_PHASE_STDS, high=MAX_PHASE_STDS
        )
        for each in SAMPLE_AGE.values()
    )


def samples_at_age(time: Array, samples: Array, ages: Array) -> Array:
    """Samples (robots, rows) as they were that much (robots,) before each row, or will be after it."""
    if not ages.any():
        return samples
    at = time - ages[:, None]
    row = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    part = np.clip((at - time[row]) / (time[row + 1] - time[row]), 0.0, 1.0)
    robots = np.arange(len(samples))[:, None]
    return np.asarray(samples[robots, row] * (1.0 - part) + samples[robots, row + 1] * part, np.float64)
