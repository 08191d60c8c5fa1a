"""Small causes beside many others, which the noise of a search hides."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from raccoon.diagnose.drives.features import BIN_S
from raccoon.diagnose.fit.noise_estimation import EXEMPT_RESPONSE_RMS, FORM_ERROR_SHARE
from raccoon.diagnose.fit.noise_model import white_noise
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.form_errors import form_weight
from raccoon.diagnose.select import missed_causes
from raccoon.diagnose.select.gates import MANY_CAUSES, WHEEL_GATE, gate
from raccoon.diagnose.select.missed_causes import add_missed_cause
from raccoon.diagnose.select.search import forward_step, prune_cause
from raccoon.diagnose.select.state import Search, refit_with_final_noise
from unit.diagnose.searches import searched

LARGE = {
    "motor.back_emf_constant@left": 1.0,
    "friction.quadratic": 0.6,
    "imu.gyro_scale": 0.8,
    "battery.discharge": 1.0,
}
MORE = {"friction.viscous": 0.8, "imu.latency": 0.6}
SMALL, HOW_MUCH = "actuation.deadband", 0.26


def named(problem: Problem, causes: Mapping[str, float] = LARGE) -> Point:
    point = problem.nominal()
    for name, size in causes.items():
        point = point.with_cause(name, np.array([size]))
    return point


def test_a_small_cause_that_the_noise_of_a_search_hides_is_found_under_that_of_the_last_fit(
    problem: Problem,
) -> None:
    search = searched(problem, named(problem).with_cause(SMALL, np.array([HOW_MUCH])), named(problem))
    going_on, _ = forward_step(search)
    assert SMALL not in going_on.fit.point.active
    last = refit_with_final_noise(search)
    # What all columns must explain does not depend on where a fit stands.
    apart = (last.linear.target - search.linear.target) / problem.features.floors
    assert np.sqrt((apart**2).mean(axis=0)).max() < 0.5
    more = add_missed_cause(last)
    assert more is not None
    assert set(more.fit.point.active) == {*LARGE, SMALL}
    assert more.leads[SMALL] >= gate(SMALL) + missed_causes.LEAD_PER_LACKING_CAUSE * (
        missed_causes.FULL_SET - len(LARGE)
    )
    assert SMALL not in more.rejections
    assert add_missed_cause(refit_with_final_noise(more)) is None


@pytest.mark.parametrize(("others", "found"), [(LARGE, False), ({**LARGE, **MORE}, True)])
def test_beside_more_causes_less_is_needed(problem: Problem, others: dict[str, float], found: bool) -> None:
    point = named(problem, others)
    search = searched(problem, point.with_cause(SMALL, np.array([0.24])), point)
    assert (add_missed_cause(refit_with_final_noise(search)) is not None) == found


def test_nothing_is_missed_where_nothing_is_missing(problem: Problem) -> None:
    search = searched(problem, named(problem), named(problem), 3)
    assert add_missed_cause(refit_with_final_noise(search)) is None


@pytest.mark.parametrize("parts", [4, 1, 0.125])
def test_in_bins_of_another_length_as_much_is_needed(problem: Problem, parts: float) -> None:
    """Means over a bin a quarter as long have twice the noise, and there are four times as many. What the
    form of a limit of the current makes of others is the same: 400 readings of (0.5 % of 9 noises) squared.
    """
    count, names = int(200 * parts), ("motor.current_limit", "a", "b", "c", "d")
    features = replace(problem.features, width=BIN_S / parts, measured=np.zeros((count, 2)))
    noise = white_noise(np.full(2, np.sqrt(parts)), np.zeros(count, np.intp))
    response = np.full((count, 2), np.hypot(9.0, EXEMPT_RESPONSE_RMS) / form_weight(names[0]))
    asked = SimpleNamespace(
        problem=SimpleNamespace(features=features),
        fit=SimpleNamespace(point=SimpleNamespace(active=names)),
        linear=SimpleNamespace(cause_responses={names[0]: response}),
        whitener=SimpleNamespace(noise=noise),
    )
    lacking = missed_causes.LEAD_PER_LACKING_CAUSE * (missed_causes.FULL_SET - len(names))
    assert missed_causes._extra_lead_needed(cast(Search, asked)) == pytest.approx(
        lacking + 400 * (FORM_ERROR_SHARE * 9.0) ** 2
    )


def test_friction_of_one_wheel_is_not_asked_for(problem: Problem) -> None:
    one_wheel = "friction.coulomb@left"
    assert gate(one_wheel) == WHEEL_GATE
    search = searched(problem, named(problem).with_cause(one_wheel, np.array([0.3])), named(problem))
    assert add_missed_cause(refit_with_final_noise(search)) is None


def test_beside_few_causes_nothing_is_asked(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    few = named(problem).without_cause("battery.discharge")
    assert len(few.active) == MANY_CAUSES - 1
    search = searched(problem, few.with_cause(SMALL, np.array([HOW_MUCH])), few)
    monkeypatch.setattr(missed_causes, "refit_candidates", lambda _: pytest.fail("asked"))
    assert add_missed_cause(refit_with_final_noise(search)) is None


def test_among_many_only_what_does_not_stand_goes(problem: Problem) -> None:
    with_small = named(problem).with_cause(SMALL, np.array([HOW_MUCH]))
    search = searched(problem, with_small, with_small)
    search.leads = dict.fromkeys(with_small.active, 30.0)
    less = prune_cause(search, "battery.discharge", "for once")
    left = set(LARGE) - {"battery.discharge"} | {SMALL}
    assert set(less.fit.point.active) == set(less.leads) == left
