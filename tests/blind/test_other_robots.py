"""What is hidden in robots that differ from the usual one is found as well."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import draw
from blind.plant import NEUTRAL
from blind.robots import USUAL, fitting, noise_of, other_robot
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from simulated_drives import BLIND_CONTROLLER

HIDDEN = {"small": "drive.backlash", "heavy": "friction.load_dependent"}
"""Of the extremes; `benchmarks/diagnosis_robots.py` has every cause of every robot."""


@pytest.mark.parametrize("name", HIDDEN)
def test_a_hidden_cause_is_named_alone_of_another_robot(name: str) -> None:
    with other_robot(name) as robot:
        hidden = fitting(draw(HIDDEN[name], np.random.default_rng(5)))
        blind = make(6, [hidden], noise=noise_of(), seconds=9.0)
        found = diagnose(blind.columns, robot, firmware=BLIND_CONTROLLER)
    assert [each.id for each in found.causes] == [hidden.id]
    (parameter, true), *_ = hidden.values.items()
    said = found.causes[0].parameters[parameter]
    assert abs(said.value - true) < 3.0 * said.std


def test_the_usual_robot_is_back_afterwards() -> None:
    with other_robot("heavy") as robot:
        assert NEUTRAL["track"] == robot.model.drive.track_width.value == 0.28
        assert robot.model.drive.track_width.std / 0.28 == pytest.approx(0.0008 / 0.16)
    assert NEUTRAL == USUAL
    assert NEUTRAL["track"] == RobotConfig().model.drive.track_width.value
