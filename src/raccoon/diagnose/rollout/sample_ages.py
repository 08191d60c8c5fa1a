"""Ages of the wheels' samples in a row, if the controller's cycle is not the row's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.hypotheses.base_coordinates import SAMPLE_PHASE_STD
from raccoon.diagnose.hypotheses.coordinates import Coordinate, Setting, Settings
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

SAMPLE_AGE: dict[str, Setting] = {side: ("sample", side, "age") for side in SIDES}
"""Additional age in s of a side's samples, beyond that of the sensor chain."""
MAX_PHASE_STDS = 1.75
"""Bound in units of `SAMPLE_PHASE_STD`: half a cycle, from the middle of one to its ends."""


def age_settings() -> Settings:
    """Neutral settings: no additional age."""
    return dict.fromkeys(SAMPLE_AGE.values(), 0.0)


def age_coordinates() -> tuple[Coordinate, ...]:
    """Base coordinates of the sample ages, one per side, since each motor is sampled at its own time in the
    cycle.

    A clock that drifts samples in the middle of a row on average; one in step with the rows may sample at any
    constant phase. A filter with another time constant does not compensate for that while wheels accelerate:
    without these coordinates, fault-free robots had a gear that loses torque, or a slip.
    """
    return tuple(
        Coordinate(
            "sample.age", (each,), lambda u: SAMPLE_PHASE_STD * u, low=-MAX_PHASE_STDS, high=MAX_PHASE_STDS
        )
        for each in SAMPLE_AGE.values()
    )


def samples_at_age(time: Array, samples: Array, ages: Array) -> Array:
    """Samples (robots, rows) interpolated at ages (robots,) in s before each row; negative ages are after."""
    if not ages.any():
        return samples
    sampled = time - ages[:, None]
    row = np.clip(np.searchsorted(time, sampled, side="right") - 1, 0, len(time) - 2)
    share = np.clip((sampled - time[row]) / (time[row + 1] - time[row]), 0.0, 1.0)
    robots = np.arange(len(samples))[:, None]
    return np.asarray(samples[robots, row] * (1.0 - share) + samples[robots, row + 1] * share, np.float64)
