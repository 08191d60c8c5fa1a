"""What a fit leaves to be expected of a robot."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.diagnose.open_numbers import OWN
from raccoon.diagnose.problem import Point, Problem
from raccoon.diagnose.spread import mean_variance, without_the_floor
from unit.diagnose.searches import plain_whitener

ROBOT = RobotConfig()
COULOMB = "friction.coulomb"


@pytest.mark.parametrize("times", [0.001, 0.02, 0.5, 3.0, 10.0, 75.0])
def test_the_mean_of_a_wander_varies_as_its_correlation_says(times: float) -> None:
    at = times * (np.arange(2000) + 0.5) / 2000
    expected = np.exp(-np.abs(at[:, None] - at[None])).mean()
    assert mean_variance(times) == pytest.approx(expected, rel=2e-3)
    assert mean_variance(0.0) == 1.0


def test_of_the_friction_that_is_found_the_floors_share_is_left_out(problem: Problem) -> None:
    rng = np.random.default_rng(4)
    point = Point(rng.standard_normal(len(problem.base)), {"drive.inertia": np.array([0.3])})
    still = plain_whitener(problem)
    assert (without_the_floor(problem, point, still).base == point.base).all()
    wanders = replace(still, wander=0.04)
    seconds = float(problem.features.time[-1] - problem.features.time[0])
    chance = 0.04 * math.sqrt(mean_variance(seconds / 4.0))
    friction = ROBOT.model.friction.coulomb
    both, own = friction.std / friction.value, OWN * friction.std / friction.value
    left = without_the_floor(problem, point, wanders)
    assert left.active == point.active
    for index, each in enumerate(problem.base):
        part = {
            (COULOMB, 2): both**2 / (both**2 + 0.5 * chance**2),
            (COULOMB, 1): own**2 / (own**2 + chance**2),
        }.get((each.settings[0][0], len(each.settings)), 1.0)
        assert left.base[index] == pytest.approx(part * point.base[index])


def test_a_number_is_expected_as_a_line_through_number_and_chance_says() -> None:
    """Drawn as `without_the_floor` has it: of both wheels and each, with a floor that adds to each."""
    rng, draws = np.random.default_rng(5), 200_000
    both, own, chance = 0.03, 0.007, 0.018
    common, *apart = (std * rng.standard_normal(draws) for std in (both, own, own))
    floor = chance * rng.standard_normal((2, draws))
    mean = common + floor.mean(axis=0)
    assert np.polyfit(mean, common, 1)[0] == pytest.approx(both**2 / (both**2 + 0.5 * chance**2), abs=0.01)
    found = apart[0] + floor[0]
    assert np.polyfit(found, apart[0], 1)[0] == pytest.approx(own**2 / (own**2 + chance**2), abs=0.01)
