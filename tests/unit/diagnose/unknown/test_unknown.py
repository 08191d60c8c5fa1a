"""What shows that something is wrong which no cause describes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import Hidden, draw
from first_problem import make_problem
from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.features import BIN_S
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.linear_model import ColumnGroup, LinearModel, coulomb_response, linearise
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.fit.wander import wandering_friction_columns
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.select.probe_scores import find_best_probe
from raccoon.diagnose.select.search import LONE_PROBE_GATE, reconsider_unknown
from raccoon.diagnose.select.state import linearise_search, start_search
from raccoon.diagnose.unknown.probes import (
    FRICTION_OVER_TIME,
    MIN_LARGE_WAVE_LOG_EVIDENCE,
    MIN_WAVE_LOG_EVIDENCE,
    estimate_motion,
    make_probe_function,
)
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX

ROBOT = RobotConfig()
CAUSES = {each.name: each for each in drive_causes()}


def test_what_was_called_unknown_is_not_where_a_cause_explains_it_after_all() -> None:
    """Once it is, a small cause beside it need not have a third of what the unknown seemed to be."""
    hidden = draw("actuation.latency", np.random.default_rng(5))
    log = log_from_columns(make(5, [hidden], seconds=10.0).columns, ROBOT)
    real = make_problem(log, ROBOT, tuple(CAUSES.values()))
    start = start_search(real, make_probe_function(real))
    seemed = {"unknown: time (inertia)": 300.0}
    empty = linearise_search(real, start.probes, start.fit.point, start.whitener, seemed)
    assert reconsider_unknown(empty) == (empty, False)
    point = start.fit.point.with_cause(
        hidden.name, np.array([hidden.values["seconds"] / CAUSES[hidden.name].coordinates[0].value(1.0)])
    )
    fit = fit_point(real, start.whitener, point)
    found = linearise_search(real, start.probes, fit.point, start.whitener, seemed)
    known, changed = reconsider_unknown(found)
    assert changed
    assert not known.unknown
    assert list(known.fit.point.active) == [hidden.name]


def test_a_bias_and_a_drift_of_the_gyro_are_no_probe(problem: Problem) -> None:
    columns = make(2, seconds=6.0).columns
    real = make_problem(log_from_columns(columns, ROBOT), ROBOT, tuple(CAUSES.values()))
    linear = linearise(real, real.nominal(), ["friction.coulomb@left", "friction.coulomb@right"])
    group = next(each for each in make_probe_function(real)(linear) if each.name.endswith("gyro over time"))
    channel = real.features.roles.index("gyro")
    time = real.features.time
    for straight in (np.ones_like(time), time - time.mean()):
        assert group.columns[:, :, channel] @ straight == pytest.approx(0.0, abs=1e-9)


def test_a_curve_over_speed_holds_no_noise_of_the_readings(problem: Problem) -> None:
    """Else it would explain that noise, and two curves that cancel otherwise would seem to act."""
    linear = linearise(problem, problem.nominal(), ["friction.coulomb@left", "friction.coulomb@right"])
    noise = np.random.default_rng(3).normal(size=linear.residual.shape) * problem.features.floors
    noisy = replace(problem, features=replace(problem.features, measured=problem.features.measured + noise))
    for name in ("speed", "gyro over speed"):
        clean, disturbed = (
            next(each.columns for each in make_probe_function(one)(its) if each.name == f"unknown: {name}")
            for one, its in ((problem, linear), (noisy, replace(linear, residual=linear.residual + noise)))
        )
        np.testing.assert_allclose(disturbed, clean, atol=1e-9)
        assert np.abs(clean).max() > 0.0


def test_friction_that_is_another_from_a_moment_on_is_a_curve(problem: Problem) -> None:
    """Of a robot that took a load; motors that get hot were named, with a probability of 1."""
    linear = linearise(problem, problem.nominal(), ["friction.coulomb@left", "friction.coulomb@right"])
    name = f"{UNKNOWN_PREFIX}{FRICTION_OVER_TIME}"
    assert name not in {each.name for each in make_probe_function(problem)(linear)}  # not of every drive
    asked = make_probe_function(replace(problem, friction_may_change=True))
    found = next(each for each in asked(linear) if each.name == name)
    later = problem.features.time > problem.features.time[0] + 0.3 * problem.features.time[-1]
    change = np.zeros_like(linear.residual)
    for side in ("left", "right"):
        response = coulomb_response(problem, linear, side)
        assert response is not None
        change += 0.03 * later[:, None] * response
    columns = found.columns.reshape(len(found.columns), -1)
    off = change.ravel() - np.linalg.lstsq(columns.T, change.ravel(), rcond=None)[0] @ columns
    assert (off**2).sum() < 0.15 * (change**2).sum()
    assert problem.features.time[later][0] == pytest.approx(found.over[later][0])


def test_in_a_short_drive_a_place_is_a_moment(problem: Problem) -> None:
    """Friction that wanders much, on a robot that was nowhere twice, is none of the place; one that is blind
    for that calls it unknown."""
    linear = linearise(problem, problem.nominal(), ["friction.coulomb@left", "friction.coulomb@right"])
    rng = np.random.default_rng(3)
    noise = problem.features.floors * rng.normal(size=linear.residual.shape)
    courses = wandering_friction_columns(problem, linear)
    wanders = 0.2 * np.tensordot(rng.normal(size=len(courses)), courses, 1)
    measured = problem.predict([problem.nominal()])[0] + noise + wanders
    real = replace(problem, features=replace(problem.features, measured=measured))

    def blind(linear: LinearModel) -> list[ColumnGroup]:
        return [replace(each, over_place=False) for each in make_probe_function(real)(linear)]

    taken = find_best_probe(start_search(real, blind))
    assert taken.name.startswith("unknown: position")
    assert taken.exceeds(LONE_PROBE_GATE)
    assert not find_best_probe(start_search(real, make_probe_function(real))).exceeds(LONE_PROBE_GATE)


def test_angles_and_places_are_those_of_the_working_point(problem: Problem) -> None:
    """Two counts of offset turned a wheel by 2 rad too much in 40 s, and its cogging was not seen."""
    settings = dict(problem.settings(problem.nominal()))
    model, roles = ROBOT.model, problem.features.roles
    speeds, bias = {"left": 5.0, "right": 7.0}, 0.02
    settings |= {("bemf.offset", side, "counts"): 9.0 for side in speeds}
    settings |= {("bemf.scale", side, "factor"): 0.99 for side in speeds}
    settings |= {("motor.back_emf_constant", side, "factor"): 1.03 for side in speeds}
    settings |= {("drive.wheel_radius", side, "factor"): 1.01 for side in speeds}
    settings |= {("imu.gyro_bias", None, "rate"): bias, ("imu.gyro_scale", None, "factor"): 1.05}
    measured = np.zeros_like(problem.features.measured)
    for side, motor in (("left", model.left), ("right", model.right)):
        volts = 0.99 * 1.03 * motor.back_emf_constant.value * speeds[side]
        measured[:, roles.index(f"bemf_{side}")] = 9.0 + volts / BEMF_VOLTS_PER_COUNT
    measured[:, roles.index("gyro")] = bias + 1.05 * model.imu.gyro_scale.value * 0.5
    found = estimate_motion(replace(problem, features=replace(problem.features, measured=measured)), settings)
    assert found is not None
    bins = len(measured)
    assert found.angle[-1] == pytest.approx([5.0 * bins * BIN_S, 7.0 * bins * BIN_S])
    assert found.heading[-1] == pytest.approx(0.5 * bins * BIN_S)
    way = np.hypot(np.diff(found.x), np.diff(found.y)).sum()
    assert way == pytest.approx(6.0 * 1.01 * model.drive.wheel_radius.value * (bins - 1) * BIN_S)


def test_a_gyro_that_drifts_does_not_turn_the_robot(problem: Problem) -> None:
    """By 0.002 rad/s in each second heading and place were 1.6 rad astray after 40 s."""
    nominal = problem.nominal()
    drifts = problem.settings(nominal) | {("imu.gyro_drift", None, "rate_per_second"): 0.002}
    (samples,), _ = problem.rollout([problem.settings(nominal), drifts])
    steady, drifting = (
        estimate_motion(replace(problem, features=replace(problem.features, measured=measured)), settings)
        for measured, settings in zip(
            problem.features.simulated(samples), (problem.settings(nominal), drifts), strict=True
        )
    )
    assert steady is not None
    assert drifting is not None
    np.testing.assert_allclose(drifting.heading, steady.heading, atol=1e-3)


def test_a_motor_that_cogs_is_seen_though_its_angle_is_counted_a_little_wrong() -> None:
    """An offset, or K_E, that is off as robot.toml allows shifted its waves on the way, and it was taken for
    noise."""
    hidden = Hidden("unknown", None, {}, {"cogging_l": 0.05, "bemf_offset_l": 5.0})
    columns = make(10, [hidden], seconds=25.0).columns
    real = make_problem(log_from_columns(columns, ROBOT), ROBOT, tuple(CAUSES.values()))
    found = find_best_probe(start_search(real, make_probe_function(real)))
    assert found.name == "unknown: wheel angle left"
    assert found.lead > 10.0 * LONE_PROBE_GATE


@pytest.mark.parametrize(("size", "seen"), [(0.01, True), (0.006, False)])
def test_a_motor_that_cogs_a_little_is_seen_by_the_one_wave_it_has(size: float, seen: bool) -> None:
    """All free columns cost more than what two of them explain is worth. A thirtieth of the friction a floor
    does as well, and to nobody's harm."""
    hidden = Hidden("unknown", None, {}, {"cogging_l": size})
    columns = make(12, [hidden], seconds=25.0).columns
    real = make_problem(log_from_columns(columns, ROBOT), ROBOT, tuple(CAUSES.values()))
    found = find_best_probe(start_search(real, make_probe_function(real)))
    assert found.name == "unknown: wheel angle left"
    assert found.lead > LONE_PROBE_GATE
    assert found.exceeds(LONE_PROBE_GATE) is seen
    assert found.min_lead == (
        MIN_LARGE_WAVE_LOG_EVIDENCE if seen else MIN_WAVE_LOG_EVIDENCE
    )  # a floor made 11 of a large one


def test_a_table_in_parts_has_each_part_beside_its_group(problem: Problem) -> None:
    search = start_search(problem, make_probe_function(problem))
    waves = [
        each for each in search.table.with_parts().inactive if each[0].name == "unknown: wheel angle right"
    ]
    (whole, span), *parts = waves
    assert len(parts) == len(whole.parts)
    assert {index for _, its in parts for index in its} == set(span)
    for part, its in parts:
        assert [span[index] for index in part.part] == its
