"""A drive of a robot as robot.toml has it, for tests of the search."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.base_coordinates import base_coordinates
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause, neutral_settings
from raccoon.diagnose.result import Diagnosis
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain
from simulated_drives import BLIND_CONTROLLER

Array = NDArray[np.float64]
Columns = Mapping[str, Array]


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


@pytest.fixture
def known_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the controller of a blind drive does is known, so that no habits are searched for."""

    def diagnose_known(columns: Columns, robot: RobotConfig, **more: Any) -> Diagnosis:
        return diagnose(columns, robot, **{**more, "firmware": BLIND_CONTROLLER})

    monkeypatch.setattr("raccoon.diagnose.recordings.drive.diagnose", diagnose_known)


@pytest.fixture(scope="module")
def problem(causes: dict[str, Cause]) -> Problem:
    """8 s of an exciting drive, without any fault."""
    robot = RobotConfig()
    log = planned_log(exciting(np.random.default_rng(1), 8.0))
    rollout = PlantRollout(log, robot, Habits(Chain.firmware(), brake=False))
    return Problem(Features.of(log), rollout, robot, neutral_settings(robot), base_coordinates(robot), causes)
