"""A drive of a robot as robot.toml has it, for tests of the search."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.base_coordinates import base_coordinates
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause, neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def causes() -> dict[str, Cause]:
    """Causes that may be found, by name: all of a drive, where a test module has no others."""
    return {each.name: each for each in drive_causes()}


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many points are simulated meanwhile: in the last number, until a test puts another 0 behind it."""
    numbers, predictions = [0], Problem.predictions

    def counted(self: Problem, points: Sequence[Point]) -> Iterator[Array]:
        numbers[-1] += len(points)
        return predictions(self, points)

    monkeypatch.setattr(Problem, "predictions", counted)
    return numbers


@pytest.fixture(scope="module")
def problem(causes: dict[str, Cause]) -> Problem:
    """8 s of an exciting drive, without any fault."""
    robot = RobotConfig()
    log = planned_log(exciting(np.random.default_rng(1), 8.0))
    rollout = PlantRollout(log, robot, Habits(Chain.firmware(), brake=False))
    return Problem(Features.of(log), rollout, robot, neutral_settings(robot), base_coordinates(robot), causes)
