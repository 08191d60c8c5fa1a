"""Motors that get hot, and friction that changed in the drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnoses import make_cause, make_diagnosis
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.linear_model import coulomb_response, linearise
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.select.gates import CROWDED_CAUSES
from raccoon.diagnose.select.state import Search, linearise_search, start_search
from raccoon.diagnose.unknown.friction_change import HEATING, friction_may_have_changed, is_clearly_heating
from raccoon.diagnose.unknown.probes import make_probe_function

ASKED = (HEATING, "friction.coulomb", "friction.coulomb@left", "friction.coulomb@right")


@pytest.fixture(scope="module")
def causes() -> dict[str, Cause]:
    return {each.name: each for each in drive_causes() if each.name in ASKED}


def _hot(problem: Problem, heated: float, added: float) -> Search:
    """A search that has named hot motors, of motors that get so hot and of a robot whose friction grows by so
    much, N m at each wheel, after a third of the drive."""
    features = problem.features
    linear = linearise(problem, problem.nominal(), list(ASKED[2:]))
    point = problem.nominal().with_cause(HEATING, np.array([heated, 0.0]))
    measured = problem.predict([point])[0]
    measured += features.floors * np.random.default_rng(2).normal(size=measured.shape)
    later = features.time > features.time[0] + 0.35 * (features.time[-1] - features.time[0])
    for side in ("left", "right"):
        response = coulomb_response(problem, linear, side)
        assert response is not None
        measured = measured + added * later[:, None] * response
    real = replace(problem, features=replace(features, measured=measured))
    start = start_search(real, make_probe_function(real))
    fit = fit_point(real, start.whitener, start.fit.point.with_cause(HEATING, np.array([0.5, 0.0])))
    return linearise_search(real, start.probes, fit.point, start.whitener)


@pytest.mark.parametrize(
    ("heated", "added", "clear"), [(2.0, 0.0, True), (0.0, 0.02, False), (1.0, 0.1, False)]
)
def test_motors_are_clearly_hot_where_no_friction_that_changed_does_it_too(
    problem: Problem, heated: float, added: float, clear: bool
) -> None:
    assert is_clearly_heating(_hot(problem, heated, added)) == clear


def test_where_no_motor_is_hot_friction_may_have_changed(problem: Problem) -> None:
    search = _hot(problem, 0.0, 0.0)
    bare = replace(search, fit=replace(search.fit, point=search.fit.point.without_cause(HEATING)))
    assert not is_clearly_heating(bare)


@pytest.mark.parametrize(
    ("others", "asked"), [(0, True), (CROWDED_CAUSES - 2, True), (CROWDED_CAUSES - 1, False)]
)
def test_beside_a_crowd_of_causes_no_change_of_friction_is_asked_for(others: int, asked: bool) -> None:
    """Beside twelve, on 36 s, the question took longer than all before it."""
    beside = [make_cause(f"own.{number}", said="") for number in range(others)]
    assert (
        friction_may_have_changed(make_diagnosis(make_cause(HEATING, said=""), *beside), lambda: False)
        is asked
    )
