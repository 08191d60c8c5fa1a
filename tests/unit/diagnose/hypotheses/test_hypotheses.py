"""What coordinates do to the settings of the simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.problems import drive_problem, starting_settings
from raccoon.diagnose.habits.trials import start_afresh
from raccoon.diagnose.hypotheses.base_coordinates import LOOP_LATENCY, MAX_BASE_STDS, base_coordinates
from raccoon.diagnose.hypotheses.cause_catalogue import causes_from, drive_causes
from raccoon.diagnose.hypotheses.coordinates import WIDTH_FACTOR, cause_name, neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.rollout.simulated_robot import Variant, to_parameters
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import effect
from raccoon.sim.effects.parameters import SIDES, Parameters
from raccoon.sim.effects.physical import plant_numbers
from simulated_drives import record_simulated_drive

ROBOT = RobotConfig()
CAUSES = {each.name: each for each in drive_causes()}


def test_a_variant_has_the_numbers_of_the_parameters_it_stands_for(problem: Problem) -> None:
    point = Point(np.full(len(problem.base), 0.3), {"motor.heating@left": np.array([0.5, 0.2])})
    settings = problem.settings(point)
    chain = Chain.firmware()
    whole = to_parameters(settings, problem.neutral, ROBOT, chain)
    variant = Variant(whole.robot, chain, settings)
    assert plant_numbers(variant) == pytest.approx(plant_numbers(whole))  # type: ignore[arg-type]


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


def test_a_model_file_brings_its_inertia_along(problem: Problem) -> None:
    settings = neutral_settings(ROBOT)
    settings[("inertia", None, "straight")], settings[("inertia", None, "turn")] = 1.3, 0.8
    model = to_parameters(settings, neutral_settings(ROBOT), ROBOT, Chain.firmware())
    assert starting_settings(ROBOT, model) == pytest.approx(settings)


@pytest.mark.parametrize(
    ("id_", "where", "parameter"),
    [
        ("actuation.latency", None, "seconds"),
        ("drive.turn_scrub", None, "torque"),
        ("bemf.dead_zone", "left", "counts"),
    ],
)
def test_of_what_a_model_to_start_from_has_there_may_be_less_down_to_none(
    problem: Problem, id_: str, where: str | None, parameter: str
) -> None:
    """Commands that came 10 ms late, of a robot whose model says 30 ms, were something unknown."""
    key, name = (id_, where, parameter), cause_name(id_, where)
    known = neutral_settings(ROBOT)
    known[key] = 0.3 * CAUSES[name].coordinates[0].value(1.0)
    causes = causes_from(list(CAUSES.values()), known)
    there = replace(problem, causes=causes, neutral=known, base=())
    low, high = there.limits(there.nominal().with_cause(name, np.zeros(1)))
    assert high == np.inf
    assert there.settings(Point(np.zeros(0), {name: low}))[key] == pytest.approx(0.0, abs=1e-12)
    assert not causes[name].one_sided
    changed = {each for each in CAUSES if causes[each] is not CAUSES[each]}
    assert changed == {name}


def test_what_is_left_open_goes_down_to_none_of_what_a_model_has_as_well() -> None:
    """A battery that loses next to nothing today, of a model that was made of one that did, is no fault."""
    log = planned_log(exciting(np.random.default_rng(1), 2.0))
    keys = ("battery.discharge", None, "volts_per_coulomb"), ("actuation.latency", None, "seconds")
    robot = Parameters.from_robot(ROBOT)
    known = robot.with_effect("battery.discharge", volts_per_coulomb=0.0004)
    known = known.with_effect("actuation.latency", seconds=0.03)
    plain, there = (
        drive_problem(log, ROBOT, [*CAUSES.values()], Habits(Chain.firmware(), False), model)
        for model in (None, known)
    )
    lowest = [each.settings(Point(each.limits(each.nominal())[0])) for each in (plain, there)]
    assert [lowest[0][key] for key in keys] == [0.0, 0.0]
    assert [lowest[1][key] for key in keys] == pytest.approx([0.0, 0.03 - MAX_BASE_STDS * LOOP_LATENCY])
    late = there.nominal().with_cause("actuation.latency", np.zeros(1))
    assert there.settings(late.moved(there.limits(late)[0]))[keys[1]] == pytest.approx(0.0, abs=1e-12)


def test_of_what_a_model_has_at_one_wheel_both_have_no_less() -> None:
    known = neutral_settings(ROBOT) | {("bemf.dead_zone", "left", "counts"): 9.0}
    causes = causes_from(list(CAUSES.values()), known)
    assert causes["bemf.dead_zone"].one_sided
    assert causes["bemf.dead_zone@right"].one_sided
    assert causes_from(list(CAUSES.values()), neutral_settings(ROBOT)) == CAUSES


@pytest.mark.parametrize(("wombat", "own"), [(False, 0.0003), (True, 0.0025)])
def test_a_clock_of_the_controllers_own_makes_commands_and_readings_as_late_as_a_cycle_by_chance(
    wombat: bool, own: float
) -> None:
    """Evenly from none to all of 5 ms, beside what else is open of both."""
    evenly = float(np.linspace(0.0, 0.005, 100001).std())
    for free_running, late in ((False, 0.0), (True, evenly)):
        found = base_coordinates(ROBOT, free_running=free_running, wombat=wombat)
        widths = {each.settings[0][:2]: each.value(1.0) for each in found if not each.factor}
        assert widths["actuation.latency", None] == pytest.approx(np.hypot(own, late), rel=1e-4)
        lag = ROBOT.model.bemf.filter_time_constant.std
        for side in SIDES:
            assert widths["bemf.filter_lag", side] == pytest.approx(np.hypot(lag, late), rel=1e-4)


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


def test_a_robot_on_soft_tyres_has_the_motors_of_robot_toml() -> None:
    """With three times the usual compliance as the most, a robot with nine times had a third of its
    resistance and three times its inertia and friction: along that scale only the compliance changes."""
    gives = {"compliance": 0.009, "damping": 0.3}
    soft = Parameters(ROBOT, {("friction.presliding", None): gives}, Chain.firmware())
    columns = record_simulated_drive(soft, 8.0, noise={"motor.0.bemf": 3.0, "motor.1.bemf": 3.0})
    log = log_from_columns(columns, ROBOT)
    problem = drive_problem(log, ROBOT, [CAUSES["drive.inertia"]], Habits(Chain.firmware(), False), None)
    point = start_afresh(problem).fit.point
    compliance = problem.settings(point)[("friction.presliding", None, "compliance")]
    assert compliance == pytest.approx(0.009, rel=0.15)
    off = {each.name: u for each, u in zip(problem.base, point.base, strict=True)}
    assert abs(off["motor.armature_resistance.factor"]) < 0.3
    assert abs(off["drive.inertia_straight"]) < 0.3
