"""What decides a cause: many moments, and fits that have arrived."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from blind.generator import Noise, make
from blind.hidden import Hidden, draw
from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.features import BIN
from raccoon.diagnose.fit import FARTHEST, Fit, _reach, fit_afresh, fit_at, fit_point
from raccoon.diagnose.forms import form_error, form_weight
from raccoon.diagnose.gain import HeldOut, contributions, size_of
from raccoon.diagnose.habits import problem_of, starting_settings
from raccoon.diagnose.hypotheses import WIDTH_FACTOR, Settings, neutral_settings
from raccoon.diagnose.linear import linearise, tabulate
from raccoon.diagnose.log import log_from_columns
from raccoon.diagnose.noise import EVENT, white_noise
from raccoon.diagnose.problem import Point, Problem, Whitener
from raccoon.diagnose.rollout import IMPOSSIBLE, Variant, flickering, heard, parameters_of
from raccoon.diagnose.select.gates import EVIDENCE_GATE, LONE_GATE, gate, gates
from raccoon.diagnose.select.joint import _all_straight, _distinct, _nearby, _of_their_families
from raccoon.diagnose.select.outlook import (
    MOST_OF_EVENT,
    Foretold,
    Rival,
    Search,
    best_probe,
    estimated,
    held_out_lead,
    lead,
    look_around,
    screen,
    start_search,
)
from raccoon.diagnose.select.refits import AFRESH, ASTRAY, MOST_AFRESH, _small, refits_afresh, shared_lags
from raccoon.diagnose.select.search import (
    NOTHING,
    PROBE_ALONE,
    SURE,
    _credible,
    _fails_held_out,
    _too_little,
    known_after_all,
)
from raccoon.diagnose.select.visible import shows_from
from raccoon.diagnose.unknown import motion_of, probes_for
from raccoon.sim.chain import Chain
from raccoon.sim.effects import effect
from raccoon.sim.physical import plant_numbers

ROBOT = RobotConfig()
CAUSES = {each.name: each for each in drive_causes()}


def plain_whitener(problem: Problem) -> Whitener:
    """Noise without memory, of the readings' floors."""
    noise = white_noise(problem.features.floors, np.zeros(len(problem.features.time), np.intp))
    still = np.zeros_like(problem.features.measured)
    return Whitener(noise, np.zeros((0, 0)), np.zeros(0), still, still)


def fit_of(problem: Problem, white: np.ndarray) -> Fit:
    base = len(problem.base)
    none = np.zeros((base, white.size))
    return Fit(problem.nominal(), white, none, float(white @ white), np.ones(base, bool))


def test_one_event_counts_for_little_and_many_for_much(problem: Problem) -> None:
    size = problem.features.measured.size
    channels = problem.features.measured.shape[1]
    before = np.ones(size)
    one = before.copy()
    one[: EVENT * channels] = 0.0
    assert lead(problem, fit_of(problem, one), fit_of(problem, before)) == pytest.approx(MOST_OF_EVENT)
    steady = lead(problem, fit_of(problem, 0.97 * before), fit_of(problem, before))
    assert steady == pytest.approx(0.5 * size * (1.0 - 0.97**2))


def test_a_floor_must_be_beaten_by_more() -> None:
    usual, slope, uneven, one_wheel = map(
        gate, ("friction.coulomb", "drive.slope", "friction.direction_dependent", "friction.coulomb@left")
    )
    assert usual == gate("imu.gyro_bias") == EVIDENCE_GATE
    assert usual < slope < uneven < one_wheel == gate("friction.stiction@right")
    for name in ("friction.stiction", "bemf.scale", "actuation.deadband"):  # pushes where a robot creeps
        assert gate(name) == gate(name, alone=True) == uneven
    assert usual < gate("bemf.scale@right") < gate("bemf.scale")
    assert gate("imu.gyro_bias", alone=True) == gates(["imu.gyro_bias"]) == LONE_GATE < EVIDENCE_GATE
    for name in ("friction.viscous", "bemf.dead_zone"):  # chance
        assert gate(name, alone=True) == gates([name]) == EVIDENCE_GATE
    assert gates(["friction.viscous", "imu.gyro_bias"]) == 2.0 * EVIDENCE_GATE


def test_a_variant_has_the_numbers_of_the_parameters_it_stands_for(problem: Problem) -> None:
    point = Point(np.full(len(problem.base), 0.3), {"motor.heating@left": np.array([0.5, 0.2])})
    settings = problem.settings(point)
    chain = Chain.firmware()
    whole = parameters_of(settings, problem.neutral, ROBOT, chain)
    variant = Variant(whole.robot, chain, settings)
    assert plant_numbers(variant) == pytest.approx(plant_numbers(whole))  # type: ignore[arg-type]


def test_a_fit_goes_on_until_it_has_arrived(problem: Problem) -> None:
    truth = problem.nominal().with_cause("drive.inertia", np.array([-0.8]))
    measured = problem.predict([truth])[0]
    problem = replace(problem, features=replace(problem.features, measured=measured))
    whitener = plain_whitener(problem)
    start = problem.nominal().with_cause("drive.inertia", np.array([0.0]))
    fit = fit_point(problem, whitener, start)
    assert fit.point.active["drive.inertia"][0] == pytest.approx(-0.8, abs=0.12)


def test_columns_add_up_to_nothing_where_nothing_changes(problem: Problem) -> None:
    """Resistance s times, inertia and friction 1/s times: the wheels turn as before, kinks and all."""
    names = ("motor.armature_resistance", "drive.inertia", "friction.coulomb", "friction.viscous")
    resistance, *others = (CAUSES[name].coordinates[0] for name in names)
    logarithms = [float(np.log(each.value(1.0))) for each in (resistance, *others[:2])]
    viscous = problem.neutral[("friction.viscous", "left", "coefficient")] / others[2].value(1.0)
    battery = next(i for i, each in enumerate(problem.base) if "internal_resistance" in each.name)
    inner = problem.neutral[("battery.internal_resistance", None, "resistance")]
    point = problem.nominal()
    for name in names:
        point = point.with_cause(name, np.zeros(1))
    linear = linearise(problem, point, [])
    along = np.zeros(len(linear.own))
    along[battery] = inner / problem.base[battery].value(1.0)
    along[len(problem.base) :] = [
        1.0 / logarithms[0], -1.0 / logarithms[1], -1.0 / logarithms[2], -viscous
    ]  # fmt: skip
    parts = along[:, None, None] * linear.own / problem.features.floors
    wheels = [index for index, role in enumerate(problem.features.roles) if role.startswith("bemf")]
    largest = max(float(np.abs(each[:, wheels]).max()) for each in parts)
    assert np.abs(parts.sum(axis=0)[:, wheels]).max() < 0.02 * largest


def test_friction_is_found_where_robot_toml_has_none() -> None:
    cause = CAUSES["friction.coulomb"]
    settings = neutral_settings(ROBOT)
    usual = settings[("friction.coulomb", "left", "torque")]
    cause.apply(settings, [1.0])
    assert settings[("friction.coulomb", "left", "torque")] > usual
    for side in ("left", "right"):
        settings[("friction.coulomb", side, "torque")] = 0.0
    cause.apply(settings, [1.0])
    width = WIDTH_FACTOR * effect("friction.coulomb").parameters[0].prior_width
    assert settings[("friction.coulomb", "right", "torque")] == pytest.approx(width)
    cause.apply(none := {**settings, ("friction.coulomb", "left", "torque"): 0.0}, [-1.0])
    assert none[("friction.coulomb", "left", "torque")] == 0.0


def search_at(problem: Problem, point: Point) -> Search:
    whitener = plain_whitener(problem)
    linear = linearise(problem, point, [])
    table, plain = tabulate(linear, [], whitener, len(problem.base))
    return Search(
        problem, probes_for(problem), fit_at(problem, whitener, point), whitener, linear, table, plain
    )  # fmt: skip


def test_half_of_a_lag_is_given_to_another_of_the_same_readings(problem: Problem) -> None:
    point = problem.nominal().with_cause("imu.latency", np.array([0.8]))
    only = replace(problem, causes={name: CAUSES[name] for name in ("imu.latency", "drive.wheel_slip")})
    ((name, start),) = shared_lags(search_at(only, point))
    assert name == "drive.wheel_slip"
    seconds = only.settings(start)
    whole = only.settings(point)[("imu.latency", None, "seconds")]
    assert seconds[("imu.latency", None, "seconds")] == pytest.approx(whole / 2.0)
    assert seconds[("drive.wheel_slip", "left", "time")] == pytest.approx(whole / 2.0)


def test_the_surer_a_cause_the_more_it_may_fall_short_on_blocks_left_out() -> None:
    """Blocks are foreseen by straight lines: a friction 20 % off, worth 25, was dropped for -0.4 there."""
    assert _fails_held_out(EVIDENCE_GATE + 1.0, EVIDENCE_GATE, -0.4)
    assert not _fails_held_out(25.0, EVIDENCE_GATE, -0.4)
    assert _fails_held_out(25.0, EVIDENCE_GATE, -20.0)
    assert not _fails_held_out(SURE, EVIDENCE_GATE, -20.0)


def test_what_shows_in_a_moment_or_two_is_told_from_what_does_not_show() -> None:
    """Wheels that stick were worth 105 in 12 s, nearly all of it where one broke loose."""
    assert _too_little(3.8, 105.1, EVIDENCE_GATE).startswith("shows in too few moments of this recording")
    assert _too_little(3.8, 5.0, EVIDENCE_GATE) == "explains too little (log evidence +3.8)"
    assert _too_little(-3.8, -3.8, EVIDENCE_GATE) == NOTHING


def test_relatives_of_the_best_are_fitted_from_every_column_too(problem: Problem) -> None:
    """A friction a fifth too large was missed: beside friction at its bound resistance had better columns."""
    white = np.zeros(4)
    names = (
        ["motor.armature_resistance@right"], ["drive.wheel_radius"], ["friction.coulomb", "imu.latency"],
        ["friction.coulomb"], ["friction.coulomb"], ["imu.gyro_scale"],
    )  # fmt: skip
    fits = []
    for each in names:
        point = Point(np.zeros(1), {name: np.zeros(1) for name in each})
        fits.append(Fit(point, white, np.zeros((1, 4)), 0.0, np.ones(1, bool)))
    assert _of_their_families(fits, fits[:3]) == [fits[3]]
    assert _of_their_families(fits, fits[1:3]) == []


def test_of_fits_that_predict_the_same_one_is_looked_at() -> None:
    fits = []
    for offset in (0.0, 0.3, 2.0, 2.2, 5.0):  # the last numbers as the first are 0.36, 16, 19.4 and 100 apart
        point = Point(np.zeros(1), {f"cause{offset}": np.zeros(1)})
        fits.append(Fit(point, np.full(4, offset), np.zeros((1, 4)), 0.0, np.ones(1, bool)))
    assert _distinct(fits, 3) == [fits[0], fits[2], fits[4]]
    assert _distinct(fits, 1) == fits[:1]


def test_two_causes_that_one_stands_for_are_proposed_at_its_place(problem: Problem) -> None:
    """A track that is wider and a K_E that is smaller than robot.toml's were taken for a smaller wheel."""
    names = ("drive.track_width", "motor.back_emf_constant@right", "drive.wheel_radius@left")
    point = problem.nominal()
    truth = point.with_cause(names[0], np.array([1.0])).with_cause(names[1], np.array([-1.0]))
    problem = replace(
        problem, features=replace(problem.features, measured=problem.predict([truth])[0])
    )  # without noise: what is proposed is algebra
    search = search_at(problem, point)
    search = replace(search, fit=fit_point(problem, search.whitener, point.with_cause(names[2], np.zeros(1))))
    linear = linearise(problem, search.fit.point, names)
    table, plain = tabulate(linear, [], search.whitener, len(problem.base))
    search = replace(search, linear=linear, table=table, plain=plain)
    proposed = [set(each.active) for each in _nearby(search)]
    assert set(names[:2]) in proposed
    assert {names[2]} not in proposed


def test_beside_what_takes_its_burden_a_number_leaves_its_bound(problem: Problem) -> None:
    """Where a base number is held, a cause is judged as if that could go back; else as before."""
    friction = problem.nominal().with_cause("friction.coulomb", np.array([0.3]))
    measured = problem.predict([friction])[0]
    problem = replace(problem, features=replace(problem.features, measured=measured))
    search = search_at(problem, problem.nominal())
    linear = linearise(problem, problem.nominal(), ["friction.coulomb", "imu.latency"])
    table, _ = tabulate(linear, [], search.whitener, len(problem.base))
    search = replace(search, table=table)
    place = next(i for i, each in enumerate(problem.base) if each.name == "friction.coulomb.torque")
    held = np.ones(len(problem.base), bool)
    loose = replace(search, fit=replace(search.fit, free=held.copy()))
    free = {group.name: gain for gain, group, _ in screen(loose)}
    held[place] = False
    bent = replace(search, fit=replace(search.fit, free=held))
    bounded = {group.name: gain for gain, group, _ in screen(bent)}
    assert bounded["friction.coulomb"] > free["friction.coulomb"]  # alone, friction would go beyond its bound
    assert max(bounded, key=lambda name: bounded[name]) == "friction.coulomb"


def test_a_silent_reading_says_that_the_speed_is_inside_the_zone_and_no_more() -> None:
    samples = np.array([[3.0, 14.0, -14.0, 14.0, -5.0, 7.0]])
    measured = np.array([0.0, 0.0, 0.0, 12.0, -2.0, np.nan])
    steady = np.zeros(6, bool)
    (none,) = heard(samples, np.array([[0.0]]), measured, steady)
    np.testing.assert_array_equal(none, samples[0])
    (zone,) = heard(samples, np.array([[10.0]]), measured, steady)
    np.testing.assert_array_equal(zone, [0.0, 4.0, -4.0, 14.0, -5.0 - 7.5 * IMPOSSIBLE, 7.0])


def test_whole_counts_are_no_dead_zone() -> None:
    samples, measured = np.array([[0.6, -0.9]]), np.array([0.0, 0.0])
    np.testing.assert_array_equal(heard(samples, np.array([[1.0]]), measured, np.zeros(2, bool)), samples)


def test_a_reading_that_noise_lifts_out_of_the_zone_says_what_a_silent_one_says() -> None:
    measured = np.zeros(200)
    measured[[50, 51, 120]] = -11.0  # far from an offset of -4, and away from 0 as noise can only be here
    measured[160:] = 30.0
    measured[130] = np.nan
    flickers = flickering(measured)
    assert list(np.flatnonzero(flickers)) == [50, 51, 120]
    samples = np.where(measured == 30.0, 29.0, -4.0)[None]
    (inside,) = heard(samples, np.array([[10.0]]), measured, flickers)
    np.testing.assert_array_equal((measured - inside)[:130], 0.0)
    np.testing.assert_array_equal(inside[160:], 29.0)
    (outside,) = heard(samples - 8.0, np.array([[10.0]]), measured, flickers)
    np.testing.assert_array_equal((measured - outside)[:130], 2.0)
    np.testing.assert_array_equal(heard(samples, np.array([[0.0]]), measured, flickers), samples)


@pytest.mark.parametrize("width", [0.5, 8.0, 13.0, 14.0, 20.0, 60.0])
def test_nothing_jumps_over_the_width_of_a_zone(width: float) -> None:
    rng = np.random.default_rng(2)
    samples, measured = 40.0 * rng.standard_normal((1, 500)), 40.0 * rng.standard_normal(500)
    measured[np.abs(measured) < 13.5] = 0.0
    steady = np.zeros(500, bool)
    before, after = (heard(samples, np.array([[width + each]]), measured, steady) for each in (-1e-6, 1e-6))
    assert np.abs(after - before).max() <= 2.1e-6 * IMPOSSIBLE


def test_a_small_dead_zone_is_found_though_wheels_stop_a_moment_early_or_late() -> None:
    found = _with_a_dead_zone(1, 0.3, 1.0)
    assert found[0] == ["bemf.dead_zone"]
    assert abs(found[1]) < 2.0


def test_beside_twice_the_noise_next_to_nothing_is_named_with_a_small_dead_zone() -> None:
    """While readings did not say how small it is, a slope was named with it. A slope is a few stops' chance
    away even so: of 36 recordings, one has a cause beside the zone that is not there."""
    found = [_with_a_dead_zone(seed, 0.2, 2.0) for seed in range(5, 11)]
    assert all("bemf.dead_zone" in names for names, _ in found)
    assert sum(names == ["bemf.dead_zone"] for names, _ in found) >= len(found) - 1
    assert np.median([abs(off) for _, off in found]) < 1.0


def _with_a_dead_zone(seed: int, size: float, noise: float) -> tuple[list[str], float]:
    """What is named, and by how many of its standard deviations the zone that was found is off."""
    hidden = draw("bemf.dead_zone", np.random.default_rng(seed), size=size)
    made = make(seed, [hidden], seconds=25.0, noise=Noise().times(noise))
    said = diagnose(made.columns, ROBOT)
    zones = [each.parameters["counts"] for each in said.causes if each.name == hidden.name]
    off = (zones[0].value - hidden.values["counts"]) / zones[0].std if zones else np.nan
    return [each.name for each in said.causes], off


def test_what_was_called_unknown_is_not_where_a_cause_explains_it_after_all() -> None:
    """Once it is, a small cause beside it need not have a third of what the unknown seemed to be."""
    hidden = draw("actuation.latency", np.random.default_rng(5))
    log = log_from_columns(make(5, [hidden], seconds=10.0).columns, ROBOT)
    real, _ = problem_of(log, ROBOT, tuple(CAUSES.values()))
    start = start_search(real, probes_for(real))
    seemed = {"unknown: time (inertia)": 300.0}
    empty = look_around(real, start.probes, start.fit.point, start.whitener, seemed)
    assert known_after_all(empty) == (empty, False)
    point = start.fit.point.with_cause(
        hidden.name, np.array([hidden.values["seconds"] / CAUSES[hidden.name].coordinates[0].value(1.0)])
    )
    fit = fit_point(real, start.whitener, point)
    found = look_around(real, start.probes, fit.point, start.whitener, seemed)
    known, changed = known_after_all(found)
    assert changed
    assert not known.unknown
    assert list(known.fit.point.active) == [hidden.name]


def test_a_fit_of_everything_starts_where_nothing_has_changed(problem: Problem) -> None:
    point = problem.nominal().with_cause("drive.inertia", np.array([0.5]))
    everything = _all_straight(search_at(problem, point))
    assert {"actuation.latency", "imu.latency", "friction.quadratic"} <= set(everything.active)
    before, after = problem.predict([point, everything])
    assert (((after - before) / problem.features.floors) ** 2).sum() < 5.0


def test_an_effect_whose_form_is_exact_is_known_better_than_one_that_is_not() -> None:
    for known in (form_error, form_weight):
        assert known("battery.open_circuit_voltage") < known("battery.discharge") < known("drive.backlash")
        assert known("drive.backlash") < known("drive.wheel_radius")


def test_steps_are_lengthened_as_much_as_columns_are_too_steep() -> None:
    steepness = np.array([1.0, 1.25, 1.6])
    ratios = 2.0 - 1.0 / steepness  # of a parabola whose curvature is overestimated that many times
    np.testing.assert_allclose([_reach(each) for each in ratios], steepness)
    assert _reach(0.3) == 1.0
    assert _reach(5.0) == FARTHEST


def test_what_would_show_shows_in_nearly_every_recording() -> None:
    power = 300.0
    said = re.search(
        r"about ([\d.]+) N m",
        shows_from(effect("friction.coulomb").parameters[0], power, gate("friction.coulomb")),
    )
    assert said is not None
    u = float(said[1]) / (WIDTH_FACTOR * effect("friction.coulomb").parameters[0].prior_width)
    evidence = 0.5 * (power * u**2 - np.log1p(power))
    chance = np.random.default_rng(1).normal(evidence, np.sqrt(power) * u, 20000)
    assert (chance > EVIDENCE_GATE).mean() == pytest.approx(0.99, abs=0.01)


def test_no_current_limit_is_promised_that_is_higher_than_those_that_were_simulated() -> None:
    limit = effect("motor.current_limit").parameters[0]
    assert shows_from(limit, 1e5, gate("motor.current_limit")) == "below about 2 A"
    assert shows_from(limit, 20.0, gate("motor.current_limit")) == "below about 0.61 A"


def test_a_bias_and_a_drift_of_the_gyro_are_no_probe(problem: Problem) -> None:
    columns = make(2, seconds=6.0).columns
    real, _ = problem_of(log_from_columns(columns, ROBOT), ROBOT, tuple(CAUSES.values()))
    linear = linearise(real, real.nominal(), ["friction.coulomb@left", "friction.coulomb@right"])
    group = next(each for each in probes_for(real)(linear) if each.name.endswith("gyro over time"))
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
            next(each.columns for each in probes_for(one)(its) if each.name == f"unknown: {name}")
            for one, its in ((problem, linear), (noisy, replace(linear, residual=linear.residual + noise)))
        )
        np.testing.assert_allclose(disturbed, clean, atol=1e-9)
        assert np.abs(clean).max() > 0.0


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
    found = motion_of(replace(problem, features=replace(problem.features, measured=measured)), settings)
    assert found is not None
    bins = len(measured)
    assert found.angle[-1] == pytest.approx([5.0 * bins * BIN, 7.0 * bins * BIN])
    assert found.heading[-1] == pytest.approx(0.5 * bins * BIN)
    way = np.hypot(np.diff(found.x), np.diff(found.y)).sum()
    assert way == pytest.approx(6.0 * 1.01 * model.drive.wheel_radius.value * (bins - 1) * BIN)


def test_a_motor_that_cogs_is_seen_though_its_readings_have_an_offset() -> None:
    hidden = Hidden("unknown", None, {}, {"cogging_l": 0.05, "bemf_offset_l": 5.0})
    columns = make(10, [hidden], seconds=40.0).columns
    real, _ = problem_of(log_from_columns(columns, ROBOT), ROBOT, tuple(CAUSES.values()))
    found = best_probe(start_search(real, probes_for(real)))
    assert found.name == "unknown: wheel angle left"
    assert found.lead > PROBE_ALONE


def test_what_acts_most_is_what_base_numbers_cannot_absorb() -> None:
    """A change of inertia within robot.toml's deviations is theirs; a latency is next to nobody else's."""
    log = log_from_columns(make(4, seconds=8.0).columns, ROBOT)
    real, _ = problem_of(log, ROBOT, tuple(CAUSES.values()))
    search = start_search(real, probes_for(real))
    both = {"drive.inertia": np.array([0.05]), "actuation.latency": np.array([1.0])}
    point = Point(np.zeros(len(real.base)), both)
    found = contributions(replace(search, fit=replace(search.fit, point=point)))
    changes = real.predict([point, *(point.without_cause(name) for name in both)])
    floor = np.sqrt((search.linear.residual**2).mean(axis=0))
    whole = [np.sqrt((((changes[0] - each) / floor) ** 2).mean()) for each in changes[1:]]
    assert found["drive.inertia"].unabsorbed < 0.5 * whole[0]
    assert 0.5 * whole[1] < found["actuation.latency"].unabsorbed < whole[1]
    most = [np.sqrt((((changes[0] - each) / floor) ** 2).mean(axis=0).max()) for each in changes[1:]]
    assert [found[name].change for name in both] == pytest.approx(most, rel=0.01)
    rough = replace(search.linear, residual=3.0 * search.linear.residual)
    less = contributions(replace(search, fit=replace(search.fit, point=point), linear=rough))
    assert less["actuation.latency"].unabsorbed == pytest.approx(
        found["actuation.latency"].unabsorbed / 3.0, rel=0.05
    )
    assert less["actuation.latency"].change == pytest.approx(most[1] / 3.0, rel=0.01)


def test_the_last_fit_takes_nothing_that_an_effect_does_for_noise() -> None:
    log = log_from_columns(make(4, seconds=8.0).columns, ROBOT)
    real, _ = problem_of(log, ROBOT, tuple(CAUSES.values()))
    search = start_search(real, probes_for(real))
    last = estimated(search)
    assert last.whitener.slow.shape[1] < search.whitener.slow.shape[1]
    assert (last.whitener.spread > 0.0).any()  # unseen data must still be allowed to be as wrong as that


def test_a_part_of_slow_friction_is_that_part_of_its_size() -> None:
    """(1 + p^2 R R')^(-1/2), with R = U s V' of two columns."""
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(40, 2))
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    noise = white_noise(np.ones(1), np.zeros(40, np.intp))
    rest = np.zeros((40, 1))
    whitener = Whitener(noise, left, 1.0 - 1.0 / np.sqrt(1.0 + sizes**2), rest, rest).with_part(0.3)
    rows = rng.normal(size=(3, 40))
    powers, vectors = np.linalg.eigh(np.eye(40) + 0.09 * columns @ columns.T)
    np.testing.assert_allclose(whitener.slowed(rows), rows @ (vectors / np.sqrt(powers)) @ vectors.T)


def test_a_model_file_brings_its_inertia_along(problem: Problem) -> None:
    settings = neutral_settings(ROBOT)
    settings[("inertia", None, "straight")], settings[("inertia", None, "turn")] = 1.3, 0.8
    model = parameters_of(settings, neutral_settings(ROBOT), ROBOT, Chain.firmware())
    assert starting_settings(ROBOT, model) == pytest.approx(settings)


def test_friction_by_direction_does_not_change_with_the_friction(problem: Problem) -> None:
    uneven = problem.nominal().with_cause("friction.direction_dependent", np.array([0.3, 0.4]))
    both = uneven.with_cause("friction.viscous", np.array([0.5]))
    parts = []
    for point in (uneven, both):
        settings = problem.settings(point)
        asymmetry = settings[("friction.direction_dependent", "left", "viscous_asymmetry")]
        parts.append(asymmetry * settings[("friction.viscous", "left", "coefficient")])
    assert parts[0] == pytest.approx(parts[1])
    assert parts[0] > 0.0


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
    table, _ = tabulate(linear, [], search.whitener, len(problem.base))
    found = dict(refits_afresh(replace(search, table=table), []))
    assert len(found) <= MOST_AFRESH
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
    astray = fit_at(problem, search.whitener, others.with_cause("drive.backlash", np.array([0.3, 0.6])))
    assert astray.evidence < search.fit.evidence - ASTRAY
    before = [("imu.gyro_bias", fit_at(problem, search.whitener, others))] * AFRESH
    table, _ = tabulate(linearise(problem, others, []), [], search.whitener, len(problem.base))
    found = dict(refits_afresh(replace(search, table=table), [*before, ("drive.backlash", astray)]))
    angle, coasting = found["drive.backlash"].point.active["drive.backlash"]
    assert angle == pytest.approx(0.03, abs=0.005)
    assert -1.0 < coasting < -0.2  # a few moments tell it from a usual one's 0
    assert found["drive.backlash"].evidence > search.fit.evidence + 10.0


@pytest.mark.parametrize("shapes", [0, 1, 2])
def test_a_little_of_a_cause_has_all_its_coordinates(problem: Problem, shapes: int) -> None:
    point = problem.nominal()
    tried = [each.active["team.own"] for each in _small(point, "team.own", shapes)]
    assert len(tried) == (2 if shapes == 0 else 6)
    assert {len(each) for each in tried} == {1 + shapes}


def held(residual: np.ndarray) -> HeldOut:
    one, nothing = np.ones(2), np.zeros(len(residual))
    return HeldOut(one, one, one, 1.0, 1.0, {}, nothing, residual, np.stack([residual, residual]), one)


def test_one_event_makes_no_model_wrong_and_a_steady_error_does() -> None:
    usual = np.random.default_rng(1).standard_normal((40 * EVENT, 2))
    event = usual.copy()
    event[:EVENT] *= 10.0
    assert held(usual).surprise == pytest.approx(1.0, abs=0.05)
    assert held(event).surprise == pytest.approx(1.0, abs=0.1)
    assert held(1.6 * usual).surprise == pytest.approx(1.6, abs=0.1)
    assert size_of(event, np.ones(2)) == pytest.approx(size_of(usual, np.ones(2)), abs=0.1)


@pytest.mark.parametrize(("seconds", "adequate", "wrong"), [(12.0, 1.15, 1.25), (2.0, 1.4, 1.6)])
def test_how_far_is_too_far_depends_on_how_much_there_is_to_judge_on(
    seconds: float, adequate: float, wrong: float
) -> None:
    bins = int(seconds / BIN)
    assert not held(np.full((bins, 2), adequate)).is_far
    assert held(np.full((bins, 2), wrong)).is_far


def test_what_wanders_slowly_may_be_further_off_by_chance() -> None:
    """In 12 s a floor has few values; what is left is counted from what is expected."""
    residual = np.full((600, 2), 1.35 * 1.5)
    wandering = replace(held(residual), expected=np.full(2, 1.5), size_before=4.0, size_after=1.35 * 1.5)
    assert not wandering.is_far  # 1.35 times what is expected
    assert replace(held(np.full((600, 2), 1.35)), size_before=4.0, size_after=1.35).is_far
    assert wandering.foreseen == pytest.approx(1.5)
    assert wandering.left == pytest.approx(1.5**2 * (1.35**2 - 1.0) / (4.0**2 - 1.5**2))
    assert replace(wandering, size_after=1.4).left == 0.0


def test_what_a_cause_gains_is_counted_from_where_the_error_is_without_it() -> None:
    """The others may do harm without it: then it gains more than there was to gain at first, and not all."""
    found = replace(held(np.ones((2, 2))), size_before=1.5, size_after=1.2, without={"a": 1.3, "b": 2.0})
    assert found.share("a") == pytest.approx((1.3**2 - 1.2**2) / (1.5**2 - 1.0))
    assert found.share("b") == pytest.approx((2.0**2 - 1.2**2) / (2.0**2 - 1.0))


def test_one_event_decides_no_more_on_blocks_left_out_than_in_a_fit(problem: Problem) -> None:
    rows = problem.features.measured.size
    worse, spoilt = np.full(rows, 1.0), np.full(rows, 1.0)
    better = np.full(rows, 0.97)
    spoilt[: EVENT * len(problem.features.roles)] = 30.0
    steady = held_out_lead(problem, Foretold(better, 0.0), Foretold(worse, 0.0))
    assert steady == pytest.approx(0.5 * rows * (1.0 - 0.97**2))
    broken_loose = held_out_lead(problem, Foretold(spoilt, 0.0), Foretold(worse, 0.0))
    assert broken_loose == pytest.approx(-MOST_OF_EVENT)
    assert held_out_lead(problem, Foretold(worse, 2.0), Foretold(worse, 0.5)) == pytest.approx(-1.5)


def test_the_size_of_an_error_is_its_root_mean_square_where_no_moment_stands_out() -> None:
    rest = np.random.default_rng(2).standard_normal((20 * EVENT + 7, 2)) * [3.0, 8.0]
    floor = np.array([1.0, 2.0])
    plain = float(np.sqrt(((rest / floor) ** 2).mean()))
    assert size_of(rest, floor) == pytest.approx(plain, rel=1e-6)
    assert size_of(0.2 * rest, floor) == pytest.approx(0.2 * plain, rel=1e-6)


def test_a_simulation_that_gives_no_numbers_is_no_fit_and_no_crash(problem: Problem) -> None:
    """Far from everything a set of causes may simulate to nonsense; its start is given up, not the search."""
    truth = problem.nominal().with_cause("drive.inertia", np.array([0.4]))
    measured = problem.predict([truth])[0]
    sound = problem.rollout

    def broken(variants: Sequence[Settings]) -> tuple[np.ndarray, float]:
        samples, step = sound(variants)
        for place, each in enumerate(variants):
            if each[("imu.latency", None, "seconds")] > 0.0:
                samples[place] = np.nan
        return samples, step

    features = replace(problem.features, measured=measured)
    problem = replace(problem, features=features, rollout=broken)
    whitener = plain_whitener(problem)
    inertia = problem.nominal().with_cause("drive.inertia", np.array([0.0]))
    starts = [inertia.with_cause("imu.latency", np.array([0.5])), inertia]
    lost, found = fit_afresh(problem, whitener, starts, 6)
    assert lost.cost == np.inf
    assert lost.evidence == -np.inf
    assert found.point.active["drive.inertia"][0] == pytest.approx(0.4, abs=0.1)


@pytest.mark.parametrize(("lead", "kept"), [(-17.0, False), (-3.0, True), (4.0, True)])
def test_what_another_outdoes_that_is_no_cause_itself_is_none_either(
    lead: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = "raccoon.diagnose.select.search"
    start: Any = SimpleNamespace(
        rivals={
            "friction.stiction": [Rival("friction.coulomb", 60.0)],
            "drive.wheel_radius@left": [Rival("friction.viscous@left", lead)],
        },
        failed={},
    )

    def without(search: SimpleNamespace, name: str, fit: object) -> SimpleNamespace:
        rest = {key: value for key, value in search.rivals.items() if key != name}
        return SimpleNamespace(rivals=rest, failed=search.failed)

    for name in ("settled_fit", "_dropped", "compared"):
        monkeypatch.setattr(f"{module}.{name}", lambda *_: None)
    monkeypatch.setattr(f"{module}.accepted_without", without)
    monkeypatch.setattr(f"{module}._stable", lambda search: search)
    found = _credible(start)
    assert ("drive.wheel_radius@left" in found.rivals) is kept
    assert "friction.stiction" in found.rivals
    assert len(found.failed) == (not kept)
