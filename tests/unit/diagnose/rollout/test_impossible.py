"""Robots that cannot be: which number of theirs it is, is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.drives import exciting
from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain

ROBOT = RobotConfig()
LOG = planned_log(exciting(np.random.default_rng(1), 1.0))
HABITS = Habits(Chain.firmware(), brake=False)


def test_an_inertia_that_a_variant_cannot_have_is_named() -> None:
    settings = neutral_settings(ROBOT) | {("inertia", None, "turn"): -1.0}
    with pytest.raises(ConfigError, match=r"model\.drive\.inertia_turn is -0\.\d+: allowed are"):
        PlantRollout(LOG, ROBOT, HABITS).samples([neutral_settings(ROBOT), settings])


def test_a_number_of_a_motor_that_a_program_made_up_is_named() -> None:
    """No file's reader has checked it."""
    left = replace(ROBOT.model.left, armature_resistance=Measured(-2.0))
    robot = replace(ROBOT, model=replace(ROBOT.model, left=left))
    with pytest.raises(ConfigError, match=r"model\.motor\.left\.armature_resistance is -2\.0: allowed are"):
        PlantRollout(LOG, robot, HABITS)
