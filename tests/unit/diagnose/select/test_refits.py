"""Causes that are fitted from other starts than where a search stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point
from raccoon.diagnose.fit.linear_model import gram_tables, linearise
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.select.refits import (
    ASTRAY_LOSS,
    MAX_CAUSES_RELINEARISED,
    MAX_REFITS_RELINEARISED,
    SMALL_SIZES,
    _small_starts,
    _visible_small_starts,
    refit_candidates,
    refit_relinearised,
    screen_candidates,
    split_lags,
)
from raccoon.diagnose.select.state import linearise_search
from unit.diagnose.searches import search_at, searched

CAUSES = {each.name: each for each in drive_causes()}


def test_half_of_a_lag_is_given_to_another_of_the_same_readings(problem: Problem) -> None:
    point = problem.nominal().with_cause("imu.latency", np.array([0.8]))
    only = replace(problem, causes={name: CAUSES[name] for name in ("imu.latency", "drive.wheel_slip")})
    ((name, start),) = split_lags(search_at(only, point))
    assert name == "drive.wheel_slip"
    seconds = only.settings(start)
    whole = only.settings(point)[("imu.latency", None, "seconds")]
    assert seconds[("imu.latency", None, "seconds")] == pytest.approx(whole / 2.0)
    assert seconds[("drive.wheel_slip", "left", "time")] == pytest.approx(whole / 2.0)


def test_a_small_deadband_is_found_beside_others_that_are_on(problem: Problem) -> None:
    """Its columns are kinked: a fit that comes from elsewhere stops where it finds nothing."""
    others = problem.nominal().with_cause("imu.latency", np.array([0.3]))
    others = others.with_cause("actuation.latency", np.array([0.2]))
    truth = others.with_cause("actuation.deadband", np.array([0.3]))
    features = problem.features
    noise = features.floors * np.random.default_rng(2).normal(size=features.measured.shape)
    measured = problem.predict([truth])[0] + noise
    problem = replace(problem, features=replace(features, measured=measured))
    search = search_at(problem, others)
    linear = linearise(problem, others, ["actuation.deadband", "friction.load_dependent", "drive.turn_scrub"])
    table, _ = gram_tables(linear, [], search.whitener)
    found = dict(refit_relinearised(replace(search, table=table), []))
    assert len(found) <= MAX_CAUSES_RELINEARISED
    assert max(found, key=lambda name: found[name].evidence).startswith("actuation.deadband")
    assert found["actuation.deadband"].point.active["actuation.deadband"] == pytest.approx(0.3, abs=0.03)


def test_what_went_astray_is_tried_from_little(problem: Problem) -> None:
    """Play too small to be guessed, of wheels that coast less than usual: a fit from elsewhere stops where it
    costs more than none."""
    others = problem.nominal().with_cause("imu.latency", np.array([0.3]))
    truth = others.with_cause("drive.backlash", np.array([0.03, -0.6]))
    features = problem.features
    noise = features.floors * np.random.default_rng(3).normal(size=features.measured.shape)
    measured = problem.predict([truth])[0] + noise
    problem = replace(problem, features=replace(features, measured=measured))
    search = search_at(problem, others)
    astray = evaluate_fit(problem, search.whitener, others.with_cause("drive.backlash", np.array([0.3, 0.6])))
    assert astray.evidence < search.fit.evidence - ASTRAY_LOSS
    before = [("imu.gyro_bias", evaluate_fit(problem, search.whitener, others))] * MAX_REFITS_RELINEARISED
    table, _ = gram_tables(linearise(problem, others, []), [], search.whitener)
    found = dict(refit_relinearised(replace(search, table=table), [*before, ("drive.backlash", astray)]))
    angle, coasting = found["drive.backlash"].point.active["drive.backlash"]
    assert angle == pytest.approx(0.03, abs=0.005)
    assert -1.0 < coasting < -0.2  # a few moments tell it from a usual one's 0
    assert found["drive.backlash"].evidence > search.fit.evidence + 10.0


@pytest.mark.parametrize("shapes", [0, 1, 2])
def test_a_little_of_a_cause_has_all_its_coordinates(problem: Problem, shapes: int) -> None:
    point = problem.nominal()
    tried = [each.active["team.own"] for each in _small_starts(point, "team.own", shapes)]
    assert len(tried) == (2 if shapes == 0 else 6)
    assert {len(each) for each in tried} == {1 + shapes}


def test_what_is_too_little_to_do_anything_is_no_start(problem: Problem) -> None:
    """No column leads on from a dead zone of less than two counts: it was fitted as many times as another."""
    search = search_at(problem, problem.nominal())
    seen = list(_visible_small_starts(search, ["bemf.dead_zone", "actuation.deadband"]))
    assert sorted(name for name, _ in seen) == ["actuation.deadband"] * 2 + ["bemf.dead_zone"]
    for name, fit in seen:
        assert fit.point.active[name][0] in SMALL_SIZES
        assert np.array_equal(fit.jacobian[:-1], search.fit.jacobian)


def test_what_robot_toml_is_bent_by_is_tried_as_its_cause(problem: Problem) -> None:
    """Where a number is at its bound the straight line says nothing for the cause that would relieve it."""
    sizes = {"drive.backlash": (0.9, 0.3), "bemf.offset@left": (-1.8,)}
    truth = wrong = with_causes(problem.nominal(), sizes)
    truth = with_causes(truth, {"motor.armature_resistance@left": (2.2,), "drive.wheel_radius@left": (1.7,)})
    wrong = with_causes(wrong, {"motor.back_emf_constant@left": (-0.9,)})
    search = searched(problem, truth, wrong, seed=2)
    fit = fit_point(search.problem, search.whitener, wrong)
    search = linearise_search(search.problem, search.probes, fit.point, search.whitener)
    right = "motor.armature_resistance@right"
    assert right not in {group.name for _, group, _ in screen_candidates(search)}
    bent = {each.settings[0]: size for each, size in zip(problem.base, fit.point.base, strict=True)}
    assert bent["motor.armature_resistance", "right", "factor"] < -2.5
    assert right in dict(refit_candidates(search))


def with_causes(point: Point, sizes: Mapping[str, tuple[float, ...]]) -> Point:
    for name, u in sizes.items():
        point = point.with_cause(name, np.array(u))
    return point
