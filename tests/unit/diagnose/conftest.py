"""A drive of a robot as robot.toml has it, for tests of the search."""

from __future__ import annotations

import numpy as np
import pytest

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.candidates import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause, neutral_settings
from raccoon.diagnose.hypotheses.open_numbers import base_coordinates
from raccoon.diagnose.rollout.variants import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain


@pytest.fixture(scope="module")
def causes() -> dict[str, Cause]:
    """Causes that may be found, by name: all of a drive, where a test module has no others."""
    return {each.name: each for each in drive_causes()}


@pytest.fixture(scope="module")
def problem(causes: dict[str, Cause]) -> Problem:
    """8 s of an exciting drive, without any fault."""
    robot = RobotConfig()
    log = planned_log(exciting(np.random.default_rng(1), 8.0))
    rollout = PlantRollout(log, robot, Habits(Chain.firmware(), brake=False))
    return Problem(Features.of(log), rollout, robot, neutral_settings(robot), base_coordinates(robot), causes)
