"""Sets of causes that are the same drive in other numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from raccoon.core.config import BatteryModel, Measured
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.findings.cause_results import cause_probability, confounded_causes
from raccoon.diagnose.findings.joint_numbers import (
    UNMEASURED_ROBOT_NOTE,
    describe_common_scale,
    describe_joint_rivals,
    unmeasured_robot_notes,
)
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.coordinates import additive_coordinate
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.diagnose.select.alternative_sets import find_better_set
from raccoon.diagnose.select.rivals import compare_rivals
from raccoon.diagnose.select.symmetry import (
    BACK_EMF_LINE,
    SYMMETRY_LINES,
    _factor_to_nominal,
    _in_base_units,
    causes_of_strained_numbers,
    exact_twins,
    move_along_line,
)
from raccoon.diagnose.select.twins import GEAR_LOSS, find_likely_twins, gear_loss_twin
from raccoon.sim.effects.chain import Chain
from unit.diagnose.searches import searched

_, RESISTANCE, WHEELS = SYMMETRY_LINES


def at(problem: Problem, **causes: float) -> Point:
    """A point with causes on by their names, _ for . after the group and __ for @."""
    point = problem.nominal()
    for key, u in causes.items():
        name = key.replace("__", "@").replace("_", ".", 1)
        size = problem.causes[name].size
        point = point.with_cause(name, np.array([u, 0.3][:size]))
    return point


def apart_by(problem: Problem, one: Point, other: Point) -> float:
    """The largest difference of two simulations, in units of the noise."""
    first, second = problem.predict([one, other])
    return float(np.abs((first - second) / problem.features.floors).max())


EVERYWHERE = {"motor_back_emf_constant__left": 0.6, "drive_inertia": -0.4, "friction_coulomb": 0.3,
              "friction_viscous": 0.4, "friction_quadratic": 0.3, "drive_turn_scrub": 0.5,
              "drive_slope": 0.4}  # fmt: skip


@pytest.mark.parametrize("factor", [0.85, 1.2])
@pytest.mark.parametrize(
    ("line", "more"),
    [
        (BACK_EMF_LINE, {}),
        (BACK_EMF_LINE, {"friction_direction_dependent": 0.5, "friction_load_dependent": 0.5}),
        (RESISTANCE, {"battery_internal_resistance": 0.5, "battery_discharge": 0.4, "motor_heating": 0.5}),
        (RESISTANCE, {"motor_current_limit": 0.5}),
        (WHEELS, {"drive_wheel_radius__right": 0.5}),
        (WHEELS, {"drive_wheel_radius": 0.5, "drive_track_width": 1.0}),
    ],
)
def test_along_a_line_the_drive_stays_the_same(
    problem: Problem, line: dict[tuple[str, str], float], more: dict[str, float], factor: float
) -> None:
    point = at(problem, **EVERYWHERE, **more)
    other = move_along_line(problem, point, line, factor)
    assert other is not None
    before, after = problem.settings(point), problem.settings(other)
    moved = [key for key in before if (key[0], key[2]) in line and before[key] not in (0.0, np.inf)]
    for key in moved:  # of inertia and of friction by direction the plant has the products
        both = before[key], after[key]
        if key[0] not in ("inertia", "friction.direction_dependent", "friction.stiction"):
            assert both[1] == pytest.approx(both[0] * factor ** line[(key[0], key[2])], rel=1e-6)
    assert apart_by(problem, problem.nominal(), point) > 20.0
    assert apart_by(problem, point, other) < 0.2


@pytest.mark.parametrize("line", [BACK_EMF_LINE, RESISTANCE])
@pytest.mark.parametrize("name", ["friction_viscous__left", "friction_coulomb__left"])
def test_what_one_wheel_has_beyond_a_number_of_both_follows_with_it(
    problem: Problem, line: dict[tuple[str, str], float], name: str
) -> None:
    """Of viscous friction that is added, and stayed: up to 4.5 times the noise."""
    point = at(problem, motor_back_emf_constant=0.5, **{name: 0.8})
    other = move_along_line(problem, point, line, 0.85)
    assert other is not None
    assert apart_by(problem, point, other) < 0.2


def test_stiction_keeps_its_form(problem: Problem) -> None:
    point = at(problem, friction_stiction=0.8, motor_back_emf_constant=0.5)
    other = move_along_line(problem, point, BACK_EMF_LINE, 1.1)
    assert other is not None
    before, after = problem.settings(point), problem.settings(other)
    for parameter, power in (("torque", 1.0), ("speed", -1.0)):
        key = ("friction.stiction", "left", parameter)
        assert after[key] == pytest.approx(before[key] * 1.1**power)


def test_every_twin_is_the_same_drive_without_its_cause(problem: Problem) -> None:
    point = at(problem, motor_back_emf_constant__left=-0.7, drive_track_width=1.2, drive_inertia=-0.5)
    found = list(exact_twins(problem, point))
    assert {name for name, _ in found} == set(point.active)
    for name, other in found:
        assert name not in other.active
        if (np.abs(other.base) < 3.4).all():  # what is cut off at its bound is not the same
            assert apart_by(problem, point, other) < 0.2


def test_a_wheel_is_the_other_one_with_another_track(problem: Problem) -> None:
    (name, other), *_ = find_likely_twins(problem, at(problem, drive_wheel_radius__right=-1.0))
    assert name == "drive.wheel_radius@right"
    assert set(other.active) == {"drive.wheel_radius@left", "drive.track_width"}


def test_without_what_is_needed_there_is_no_twin(problem: Problem) -> None:
    causes = {key: each for key, each in problem.causes.items() if key != "drive.track_width"}
    point = at(problem, drive_wheel_radius__right=-1.0)
    assert list(exact_twins(replace(problem, causes=causes), point)) == []


@pytest.mark.parametrize(
    ("bent", "named"),
    [
        ({3: -3.0}, {"motor.armature_resistance@left"}),
        ({3: 2.6, 7: 3.0}, {f"motor.armature_resistance{end}" for end in ("", "@left", "@right")}),
        ({3: 2.6, 7: -3.0}, {f"motor.armature_resistance@{side}" for side in ("left", "right")}),
        ({11: 2.8}, {"friction.coulomb"}),
        ({15: 2.8}, {"friction.coulomb@right"}),
        ({25: 3.0, 26: 2.6}, {"drive.inertia"}),
        ({25: 3.0, 26: 2.0}, set()),
    ],
)
def test_what_is_bent_far_can_be_said_as_its_cause(
    problem: Problem, bent: dict[int, float], named: set[str]
) -> None:
    point = problem.nominal()
    point.base[list(bent)] = list(bent.values())
    found = dict(causes_of_strained_numbers(problem, point, 2.5))
    assert set(found) == named
    for name, other in found.items():
        assert set(other.active) == {name}
        assert other.base @ other.base < point.base @ point.base
        assert apart_by(problem, point, other) < 0.01
    on = problem.nominal().with_cause("motor.armature_resistance@left", np.array([0.5]))
    on.base[3] = 3.0
    assert list(causes_of_strained_numbers(problem, on, 2.5)) == []


FEW = ("motor.back_emf_constant", "drive.inertia", "drive.track_width", "drive.wheel_radius",
       "friction.coulomb", "friction.load_dependent", "imu.gyro_scale")  # fmt: skip


BOTH = {"motor_back_emf_constant__left": -0.8, "motor_back_emf_constant__right": -1.7}


def among_few(problem: Problem) -> Problem:
    """The problem with a few causes alone, which is quicker."""
    return replace(problem, causes={name: each for name, each in problem.causes.items() if each.id in FEW})


def test_three_causes_that_are_two_of_the_other_motor_become_those(problem: Problem) -> None:
    truth = at(problem, motor_back_emf_constant__right=1.2, friction_load_dependent=0.5)
    wrong = move_along_line(problem, truth, BACK_EMF_LINE, 1.0 / float(np.exp(0.12)))
    assert wrong is not None
    assert "motor.back_emf_constant@left" in wrong.active
    assert len(wrong.active) > 3
    search = searched(among_few(problem), truth, wrong, seed=3)
    better = find_better_set(search)
    assert better is not None
    assert set(better.point.active) == set(truth.active)


def test_a_set_that_is_nearly_as_likely_is_said_with_the_cause_whose_place_it_takes(problem: Problem) -> None:
    name, cause = "drive.wheel_radius@right", problem.causes["drive.wheel_radius@right"]
    named = at(problem, drive_wheel_radius__right=-1.0)
    search = searched(
        among_few(problem), at(problem, drive_wheel_radius__left=1.0, drive_track_width=1.2), named, seed=3
    )
    search = replace(search, fit=fit_point(search.problem, search.whitener, named))
    compare_rivals(search)
    told = describe_joint_rivals(search, cause)
    assert told == " drive.track_width and drive.wheel_radius@left together would look the same."
    assert {"drive.wheel_radius@left", "drive.track_width"} <= set(confounded_causes(search, cause))
    assert cause_probability(search, name, confounded_causes(search, cause), {}) < 0.8
    clear = searched(among_few(problem), at(problem, drive_wheel_radius__right=-1.4), named, seed=3)
    compare_rivals(clear)
    assert describe_joint_rivals(clear, cause) == ""
    assert "drive.track_width" not in confounded_causes(clear, cause)


def test_in_a_crowd_a_set_of_one_cause_more_is_said_too(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The misfit is the same, and where much is wrong one more is no wonder."""
    names = ("motor.back_emf_constant@left", "motor.back_emf_constant@right")
    named = at(problem, **BOTH, friction_coulomb=0.4)
    search = searched(among_few(problem), named, named, seed=3)
    search = replace(search, fit=fit_point(search.problem, search.whitener, named))

    def together() -> list[set[str]]:
        compare_rivals(search)
        found = (each for name in names for each in search.rivals[name] if each.together)
        return [{each.name, *each.together} for each in found]

    assert together() == []
    monkeypatch.setattr("raccoon.diagnose.select.rivals.MANY_CAUSES", 3)
    assert {"drive.inertia", "drive.track_width"} in together()
    leads = [each.lead for name in names for each in search.rivals[name] if each.together]
    assert all(lead >= 0.0 for lead in leads)  # or the cause would be outdone by what is only spared


def test_of_both_back_emf_constants_it_is_said_what_they_rest_on(problem: Problem) -> None:
    point = at(problem, drive_inertia=0.5, **BOTH)
    search, here = searched(problem, point, point), problem.settings(point)
    search.fit = replace(search.fit, point=point)
    keys = [("motor.back_emf_constant", side, "factor") for side in ("left", "right")]
    off = float(np.sqrt(np.prod([here[key] for key in keys])))
    other = move_along_line(problem, point, BACK_EMF_LINE, 1.0 / off)
    assert other is not None
    assert apart_by(problem, point, other) < 0.2
    there = problem.settings(other)

    def told(name: str) -> str:
        return describe_common_scale(search, problem.causes[name], FitUncertainty(here, (), np.zeros((0, 0))))

    def changed(*keys: tuple[str, str | None, str]) -> str:
        factor = float(np.prod([there[key] / here[key] for key in keys]))
        return f"{100.0 * abs(factor - 1.0):.0f} % {'more' if factor > 1.0 else 'less'}"

    said = told("motor.back_emf_constant@left")
    turn = ("inertia", None, "turn"), ("drive.inertia", None, "factor")
    assert f"inertia {changed(*turn)}" in said
    assert f"dry friction {changed(('friction.coulomb', 'left', 'torque'))}" in said
    assert f"the track {changed(('drive.track_width', None, 'factor'))}" in said
    assert told("motor.back_emf_constant@right") == told("drive.inertia") == ""
    search.fit = replace(search.fit, point=point.without_cause("drive.inertia"))
    assert told("motor.back_emf_constant@left") == ""


def test_many_causes_of_the_documentations_robot_say_that_it_may_not_have_been_measured(
    problem: Problem,
) -> None:
    few, many = at(problem, drive_inertia=0.5), at(problem, **EVERYWHERE)
    search = searched(problem, few, few)
    for point, note in ((few, ()), (many, (UNMEASURED_ROBOT_NOTE,))):
        search.fit = replace(search.fit, point=point)
        assert unmeasured_robot_notes(search) == note
    model = replace(problem.robot.model, battery=BatteryModel(open_circuit_voltage=Measured(7.0, 0.03)))
    measured = replace(search.problem, robot=replace(problem.robot, model=model))
    assert unmeasured_robot_notes(replace(search, problem=measured)) == ()


def test_along_a_line_a_number_that_counts_by_what_is_added_comes_back_to_what_it_was(
    problem: Problem,
) -> None:
    """Viscous friction goes with the square of K_E: half again as much needs the root of two thirds."""
    key, name = ("friction.viscous", "left", "coefficient"), "friction.viscous"
    width = problem.causes[name].coordinates[0].value(1.0)
    point = problem.nominal().with_cause(name, np.array([0.5 * problem.neutral[key] / width]))
    assert problem.settings(point)[key] == pytest.approx(1.5 * problem.neutral[key])
    factor = _factor_to_nominal(problem, point, name, BACK_EMF_LINE)
    assert factor == pytest.approx((2.0 / 3.0) ** 0.5)
    there = move_along_line(problem, point, BACK_EMF_LINE, factor)
    assert there is not None
    assert name not in there.active
    assert problem.settings(there)[key] == pytest.approx(problem.neutral[key])


def test_a_friction_that_robot_toml_has_none_of_is_counted_in_what_is_added_to_it(problem: Problem) -> None:
    """A factor of none is none, so a cause adds to it; taken for a factor its torque was a hundred times too
    large in robot.toml's deviations."""
    (cause,) = problem.causes["friction.coulomb"].coordinates
    base = additive_coordinate("friction.coulomb", None, "torque", 0.01)
    torque = dict.fromkeys(cause.settings, 0.0)
    cause.apply(torque, 0.3)
    (size,) = set(torque.values())
    assert _in_base_units(base, cause, 0.3) == pytest.approx(size / 0.01)


def test_gears_that_lose_torque_are_more_inertia_and_friction_where_no_motor_brakes(
    problem: Problem,
) -> None:
    steps = np.repeat([(0.0, 0.0), (0.4, 0.4), (0.8, 0.7), (1.0, 1.0), (0.0, 0.0)], 160, axis=0)
    log = planned_log(steps)
    rollout = PlantRollout(log, problem.robot, Habits(Chain.firmware(), brake=False))
    forward = replace(problem, features=Features.of(log), rollout=rollout)
    point = at(forward, friction_load_dependent=0.8)
    other = gear_loss_twin(forward, point)
    assert other is not None
    assert set(other.active) == {"drive.inertia", "friction.coulomb"}
    lost = apart_by(forward, forward.nominal(), point)
    assert lost > 10.0
    assert apart_by(forward, point, other) < 0.1 * lost
    back = gear_loss_twin(forward, other)
    assert back is not None
    assert set(back.active) == {GEAR_LOSS}
    np.testing.assert_allclose(back.active[GEAR_LOSS], point.active[GEAR_LOSS], rtol=0.05)


def test_a_k_e_that_is_low_may_be_gears_that_lose_torque_beside_a_track(problem: Problem) -> None:
    """Of a robot whose gears lost 17 % and whose gyro read 6 % too much, K_E of both motors was said 6.5 %
    low with a probability of 1; the truth was 7.6 of log evidence ahead, and lacked 2.4 with its gates."""
    point = at(problem, motor_back_emf_constant=-1.0)
    twins = [set(other.active) for _, other in find_likely_twins(problem, point)]
    assert any({GEAR_LOSS, "drive.track_width"} <= each for each in twins)
