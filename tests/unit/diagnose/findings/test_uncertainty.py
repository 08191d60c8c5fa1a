"""How sure the numbers of a fit are said to be."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np
import pytest

from raccoon.diagnose.findings import uncertainty
from raccoon.diagnose.findings.cause_results import fitted_parameters, widen_for_rivals
from raccoon.diagnose.findings.uncertainty import (
    COORDINATE_STEP,
    LATENCY,
    NOISE_LEARNING_S,
    FitUncertainty,
    _stair_curvature,
    _unnamed_responses,
    coordinate_covariance,
    setting_value,
)
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import WIDTH_FACTOR, Cause, Settings
from raccoon.diagnose.hypotheses.form_errors import min_form_error, relative_form_error
from raccoon.diagnose.rollout.encoder_window import WINDOW
from raccoon.diagnose.select.rivals import LEAD_PER_E_FOLD, MAX_CLASS_LEAD
from raccoon.diagnose.select.state import Rival
from unit.diagnose.searches import searched

CAUSES = {
    each.name: each
    for each in drive_causes()
    if each.id in ("imu.latency", "drive.wheel_slip", "imu.gyro_bias", "friction.coulomb")
}


@pytest.fixture(scope="module")
def causes() -> dict[str, Cause]:
    return CAUSES


def test_what_is_held_at_a_bound_does_not_make_others_seem_to_disagree(problem: Problem) -> None:
    """How much blocks of time disagree is a question to the coordinates that are free. One that is held and
    acts just like a free one leaves the number less sure, as it may be the other's, by what the curvature
    says and by nothing else."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    search = searched(problem, late, late)
    fit, held, own = search.fit, 0, len(problem.base)
    factors = []
    for alike in (0.0, 0.9999):
        columns = fit.jacobian.copy()
        columns[held] = alike * columns[own]
        free = fit.free.copy()
        free[held] = False
        bound = replace(search, fit=replace(fit, jacobian=columns, free=free))
        said = coordinate_covariance(bound)
        curvature = np.linalg.inv(np.eye(len(columns)) + columns @ columns.T)
        factors.append(said[own, own] / curvature[own, own])
    features = problem.features
    assert factors[1] == pytest.approx(factors[0])
    assert factors[0] >= 1.0 + NOISE_LEARNING_S / (len(features.time) * features.width)


@pytest.mark.parametrize(("scale", "widened"), [(3.0, True), (0.3, False)])
def test_where_blocks_of_time_disagree_numbers_are_less_sure(
    problem: Problem, scale: float, widened: bool
) -> None:
    """By White's sandwich, in the mean; where they agree better than noise would, that is chance."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    search = searched(problem, late, late)
    fit = replace(
        search.fit,
        whitened_residual=scale * np.random.default_rng(5).normal(size=search.fit.whitened_residual.size),
    )
    columns, vector = fit.jacobian[fit.free], fit.point.vector()[fit.free]
    covariance = np.linalg.inv(np.eye(len(columns)) + columns @ columns.T)
    target = fit.whitened_residual + vector @ columns
    left = target - covariance @ columns @ target @ columns
    edges = np.linspace(0, len(left), 9).astype(int)
    scores = np.array([columns[:, one:two] @ left[one:two] for one, two in pairwise(edges)])
    sandwich = covariance @ (scores.T @ scores) @ covariance
    ratio = float(np.mean(np.diag(sandwich) / np.diag(covariance)))
    assert (ratio > 1.0) == widened
    features = problem.features
    short = 1.0 + NOISE_LEARNING_S / (len(features.time) * features.width)
    plain = np.linalg.inv(fit.curvature)
    said = coordinate_covariance(replace(search, fit=fit))
    np.testing.assert_allclose(said, plain * max(ratio, 1.0) * short, rtol=1e-6, atol=1e-12)


def test_numbers_of_a_short_drive_are_less_sure(problem: Problem) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    search = searched(problem, late, late)
    features, key = problem.features, ("imu.latency", None, "seconds")
    longer = replace(features, width=10.0 * features.width)
    late_half = features.time > features.time[len(features.time) // 2]
    with_a_gap = replace(features, time=features.time + 60.0 * late_half)  # in which nothing is learnt
    others = (replace(search, problem=replace(problem, features=each)) for each in (longer, with_a_gap))
    stds = [FitUncertainty.of(each).std(key) for each in (search, *others)]
    span = len(features.time) * features.width
    assert (stds[0] / stds[1]) ** 2 == pytest.approx(
        (1.0 + NOISE_LEARNING_S / span) / (1.0 + 0.1 * NOISE_LEARNING_S / span)
    )
    assert stds[2] == pytest.approx(stds[0])


def test_a_late_command_of_encoders_is_known_to_a_row_only(problem: Problem) -> None:
    """Of rows of 5 ms 16.2 +- 0.1 and 16.9 +- 0.7 ms were said where commands were 13.5 ms late."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    search = searched(problem, late, late)
    by_encoders = replace(problem, neutral={**problem.neutral, WINDOW: 0.012})
    plain, read = FitUncertainty.of(search), FitUncertainty.of(replace(search, problem=by_encoders))
    command, gyro = (LATENCY, None, "seconds"), ("imu.latency", None, "seconds")
    here = {**read.settings, command: 0.01}
    moved = (
        {**here, command: 0.01 + 1e-3 * COORDINATE_STEP},
        *({**each, command: 0.01} for each in read.moved_settings[1:]),
    )
    row = 0.012 / np.sqrt(12.0)
    own_std = replace(plain, settings=here, moved_settings=moved).std(command)
    assert 0.0 < own_std < row
    assert replace(read, settings=here, moved_settings=moved).std(command) == pytest.approx(
        np.hypot(own_std, row)
    )
    assert read.std(gyro) == pytest.approx(plain.std(gyro))
    assert plain.std(gyro) > 0.0


@pytest.mark.parametrize(("narrow", "curvature"), [(0.0, 1.0), (10.0, 100.0)])
def test_on_a_flat_stair_a_number_is_as_sure_as_the_way_to_either_side_says(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, narrow: float, curvature: float
) -> None:
    """The prior is a part of what rises on that way. Where the misfit says nothing a number is known as well
    as the prior has it, and not better by a root of two.

    narrow: by how much the misfit rises within a width of the prior, its root."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.0]))
    search = searched(problem, late, late)
    own = len(problem.base)
    flat = search.fit.jacobian.copy()
    flat[own] = 0.0
    vector = search.fit.point.vector()

    def costs(_: Problem, __: object, points: list[Point]) -> np.ndarray:
        moved = np.array([each.vector() - vector for each in points])
        rise = (moved[:, own] * narrow) ** 2 + [each.vector() @ each.vector() for each in points]
        return np.asarray(rise - vector @ vector + search.fit.cost, float)

    monkeypatch.setattr(uncertainty, "costs_at", costs)
    monkeypatch.setattr(Problem, "limits", lambda *_: (np.full(own + 1, -9.0), np.full(own + 1, 9.0)))
    found = _stair_curvature(replace(search, fit=replace(search.fit, jacobian=flat)))
    assert 1.0 + found[own] == pytest.approx(curvature)
    assert not found[:own].any()


def test_beside_another_cause_a_number_is_less_sure(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By what is not named and looks like it, and by what is inexact of the other."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    both = late.with_cause("imu.gyro_bias", np.array([1.0]))
    cause, stds = CAUSES["imu.latency"], {}
    for point in (late, both):
        search = searched(problem, point, point)
        for unnamed in (0.0, 0.05):
            monkeypatch.setattr("raccoon.diagnose.findings.uncertainty.UNNAMED_CAUSE_WIDTH", unnamed)
            number = fitted_parameters(search, cause, FitUncertainty.of(search))["seconds"]
            stds[len(point.active), unnamed] = number.std
    assert stds[1, 0.0] == stds[1, 0.05]
    assert stds[1, 0.0] < stds[2, 0.0] < stds[2, 0.05]
    slip = CAUSES["drive.wheel_slip"].coordinates[0].value(1.0)  # s: a little of it bends the latency as much
    assert stds[2, 0.05] < 0.05 * slip


def test_what_is_not_named_counts_as_coordinates_under_unit_priors(problem: Problem) -> None:
    """That are fitted as well, and of which nobody asks."""
    both = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    both = both.with_cause("imu.gyro_bias", np.array([1.0]))
    search = searched(problem, both, both)
    columns, unnamed = search.fit.jacobian, _unnamed_responses(search)
    assert len(unnamed) > 1
    every = np.vstack([columns, 30.0 * unnamed])
    whole = np.linalg.inv(np.eye(len(every)) + every @ every.T)[: len(columns), : len(columns)]
    thirty = replace(search, whitener=cast(Whitener, lambda each: 30.0 * search.whitener(each)))
    said = coordinate_covariance(thirty)
    np.testing.assert_allclose(said * (whole[0, 0] / said[0, 0]), whole, rtol=1e-6, atol=1e-10)
    assert said[0, 0] >= whole[0, 0]


def test_a_number_has_the_error_of_its_form_as_well(problem: Problem) -> None:
    """A share of how far it is from nominal, and a part of its width for the root of how many are named."""
    both = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    both = both.with_cause("imu.gyro_bias", np.array([1.0]))
    search = searched(problem, both, both)
    known = replace(FitUncertainty.of(search), covariance=np.zeros((len(both.vector()), len(both.vector()))))
    for name, cause in CAUSES.items():
        (parameter,) = (each for each in cause.effect.parameters if each.name != "at_once")
        found = fitted_parameters(search, cause, known)[parameter.name]
        least = min_form_error(name, 1) * np.sqrt(2.0) * WIDTH_FACTOR * parameter.prior_width
        assert found.std == pytest.approx(
            np.hypot(relative_form_error(cause.id) * (found.value - found.nominal), least)
        )
    late = fitted_parameters(search, CAUSES["imu.latency"], known)["seconds"]
    assert late.std > relative_form_error("imu.latency") * late.value > 0.0


def test_an_inertia_is_counted_with_what_is_open_of_it_straight_and_turning() -> None:
    key, open_ = ("drive.inertia", None, "factor"), (("inertia", None, each) for each in ("straight", "turn"))
    settings: Settings = {key: 1.2, **dict(zip(open_, (1.21, 0.81), strict=True))}
    assert setting_value(settings, key) == pytest.approx(1.2 * 1.1 * 0.9)


def test_a_number_is_as_sure_as_what_it_would_be_beside_a_rival_of_another_cause(problem: Problem) -> None:
    """By the mixture of what is said and of what each rival would have it be; what cannot be, or is the same
    set twice, does not count twice, and a cause's own rivals say whether it is there and not how large."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    both = late.with_cause("imu.gyro_bias", np.array([1.0]))
    search = searched(problem, both, both)
    key, cause = ("imu.latency", None, "seconds"), CAUSES["imu.latency"]
    here = problem.settings(search.fit.point)
    there = {**here, key: here[key] + 0.02}
    alone = fitted_parameters(search, cause, FitUncertainty.of(search))

    def std(name: str, *rivals: Rival) -> float:
        search.rivals = {name: list(rivals)}
        return widen_for_rivals(search, cause, alone)["seconds"].std

    own = alone["seconds"].std
    even, far = Rival("a", 0.0, settings=there), Rival("a", MAX_CLASS_LEAD, settings=there)
    assert std("imu.gyro_bias", even) ** 2 - own**2 == pytest.approx(0.5 * 0.02**2)
    behind = 1.0 / (1.0 + np.e)
    assert std("imu.gyro_bias", replace(even, lead=LEAD_PER_E_FOLD)) ** 2 - own**2 == pytest.approx(
        behind * 0.02**2
    )
    halves = (replace(even, together=("b",)), replace(even, name="b", together=("a",)))
    assert std("imu.gyro_bias", *halves) == pytest.approx(std("imu.gyro_bias", even))
    assert (
        std("imu.gyro_bias", far) == std("imu.gyro_bias", Rival("a", 0.0)) == std("imu.latency", even) == own
    )
