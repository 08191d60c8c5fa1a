"""The simulator driven by several recordings of one robot, each from its own initial state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.hypotheses.per_recording import settings_of_recording
from raccoon.diagnose.own import OwnEffect
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout, Rollout

Array = NDArray[np.float64]


class JoinedRollout:
    """One plant per recording: motors are cold again in each, and the battery has the state of that
    recording."""

    def __init__(self, parts: Sequence[Rollout]) -> None:
        self._parts = tuple(parts)

    def __call__(self, variants: Sequence[Settings]) -> tuple[Iterator[Array], float]:
        found = [part(settings_of_recording(variants, number)) for number, part in enumerate(self._parts)]
        lanes = zip(*(each for each, _ in found), strict=True)
        return (np.concatenate(each, axis=2) for each in lanes), found[0][1]


def make_rollout(log: Log, robot: RobotConfig, habits: Habits, own: Sequence[OwnEffect] = ()) -> Rollout:
    """The package's plant driven by a log's commands, recording by recording."""
    parts = [PlantRollout(each, robot, habits, own=own) for each in log.split_recordings()]
    return parts[0] if len(parts) == 1 else JoinedRollout(parts)
