"""What a recording does not say of the controller, and how it is found out."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from blind.generator import make
from blind.hidden import Hidden, draw
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.excitation import swing_period
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.levenberg_marquardt import ROUGH_DECREASE
from raccoon.diagnose.fit.problem import Point, Problem, transfer_columns, transfer_point
from raccoon.diagnose.habits.alternatives import (
    HOPELESS_DEFICIT,
    MIN_LOG_EVIDENCE_LEAD,
    _ended_far_behind,
    _grown_crowded_and_behind,
    adopt_if_ahead,
    fit_best_start,
    log_evidence_lead,
    try_battery_filters,
    try_friction_forms,
)
from raccoon.diagnose.habits.chain_trials import try_commands_until_row, try_sensor_chains
from raccoon.diagnose.habits.chains import FREE_RUNNING, PAUSING_AT_CYCLE_END
from raccoon.diagnose.habits.controller import find_habits
from raccoon.diagnose.habits.habit_search import FIRST_STEPS, HabitStep, _grow, search_with_habits
from raccoon.diagnose.habits.lags import try_lagging_readings
from raccoon.diagnose.habits.notes import COMMAND_IN_FORCE_BEFORE, habit_notes
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.habits.trials import MAX_CACHED_STARTS, HabitTrials, RunSearch, start_afresh
from raccoon.diagnose.hypotheses.base_coordinates import LOOP_LATENCY, MAX_BASE_STDS, WheelSliding
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.result import Verdict
from raccoon.diagnose.rollout.firmware import FIRMWARES, Firmware
from raccoon.diagnose.rollout.plant_rollout import Habits, _controller_cycle
from raccoon.diagnose.select.alternative_sets import lead_over_search
from raccoon.diagnose.select.gates import CROWDED_CAUSES
from raccoon.diagnose.select.search import continue_selection, run_search, start_selection
from raccoon.diagnose.select.state import Search, linearise_search
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.recording import median_step
from simulated_drives import BLIND_CONTROLLER, record_simulated_drive
from unit.diagnose.searches import search_at, standing

Array = NDArray[np.float64]
Effects = dict[tuple[str, str | None], dict[str, float]]

ROBOT = RobotConfig()
CAUSES = drive_causes()
SLIDING: dict[WheelSliding, Effects] = {
    WheelSliding.RIGID: {},
    WheelSliding.COMPLIANT: {("friction.presliding", None): {"compliance": 0.001, "damping": 0.3}},
    WheelSliding.CREEPING: {("friction.presliding", None): {"creep": 0.08, "creep_tail": 0.3}},
}


def test_a_late_gyro_is_not_taken_for_another_filter_of_the_controller() -> None:
    hidden = [
        draw(each, np.random.default_rng(3)) for each in ("battery.open_circuit_voltage", "imu.latency")
    ]
    log = log_from_columns(make(3, hidden, seconds=10.0).columns, ROBOT)
    _, habits = find_habits(log, ROBOT, CAUSES, None)
    assert habits.chain == Chain.firmware()


@pytest.mark.parametrize("chain", [Chain(), Chain.firmware()])
def test_the_controllers_filter_is_found_out(chain: Chain) -> None:
    sticky = {"torque": 0.05, "speed": 0.5}
    robot = Parameters(
        ROBOT, {("friction.stiction", "left"): sticky, ("friction.stiction", "right"): sticky}, chain
    )
    _, habits = find_habits(log_from_columns(record_simulated_drive(robot, 10.0), ROBOT), ROBOT, CAUSES, None)
    assert habits.chain == chain


@pytest.mark.parametrize("chain", [Chain(), Chain.firmware()])
def test_the_filter_of_a_gentle_drive_is_the_one_under_which_robot_toml_is_right(chain: Chain) -> None:
    """Commands that go up and down within 0.4 s, and 20 counts of noise: the plain filter saves less than is
    asked of it, but the firmware's would need another time constant, which was named."""
    robot = Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT], chain)
    columns = record_simulated_drive(
        robot, 8.0, softened=80, noise={"motor.0.bemf": 20.0, "motor.1.bemf": 20.0}
    )
    _, habits = find_habits(log_from_columns(columns, ROBOT), ROBOT, CAUSES, None)
    assert habits.chain == chain


@pytest.mark.parametrize("seconds", [0.02, 0.1])
def test_a_slow_filter_of_the_battery_is_seen_before_any_cause_is_known(seconds: float) -> None:
    """Beside a deadband one of 0.1 s was taken for 0.05, once a wrong scale and friction were named."""
    chain = replace(Chain.firmware(), battery_time_constant=seconds)
    robot = Parameters(
        ROBOT, SLIDING[WheelSliding.COMPLIANT] | {("actuation.deadband", None): {"duty": 0.05}}, chain
    )
    _, habits = find_habits(log_from_columns(record_simulated_drive(robot, 8.0), ROBOT), ROBOT, CAUSES, None)
    assert habits.chain == chain


def test_a_battery_that_creeps_after_its_current_is_nothing_unknown() -> None:
    """By 10 mohm more after 8 s."""
    robot = Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT], Chain.firmware())
    columns = dict(record_simulated_drive(robot, 20.0))
    sag = ROBOT.model.battery.open_circuit_voltage.value - columns["battery.voltage"]
    late, stays = np.zeros_like(sag), math.exp(-0.005 / 8.0)
    for row in range(1, len(sag)):
        late[row] = stays * late[row - 1] + (1.0 - stays) * sag[row]
    part = 0.01 / ROBOT.model.battery.internal_resistance.value
    columns |= {"battery.voltage": columns["battery.voltage"] - part * late}
    said = diagnose(columns, ROBOT, firmware=BLIND_CONTROLLER)
    assert said.verdict is Verdict.ADEQUATE
    assert said.causes == ()


HIDING = {
    "actuation.deadband": {"duty": 0.066},
    "bemf.scale": {"factor": 1.08},
    "motor.current_limit": {"limit": 1.6},
}


@pytest.mark.parametrize("id_", HIDING)
def test_what_no_base_number_can_stand_in_for_does_not_hide_the_filter(id_: str) -> None:
    wrong = Parameters.from_robot(ROBOT).with_effect(
        id_, "left" if id_ == "bemf.scale" else None, **HIDING[id_]
    )
    _, habits = find_habits(
        log_from_columns(record_simulated_drive(wrong, 12.0, seed=1), ROBOT), ROBOT, CAUSES, None
    )
    assert habits.chain == Chain()


def test_a_resistance_that_an_unpaused_controller_imitates_is_said_so() -> None:
    """What is measured of a motor is the same where it is unpowered a tenth of the time."""
    lower: Effects = {("motor.armature_resistance", place): {"factor": 0.9} for place in ("left", "right")}
    weaker = Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT] | lower, Chain.firmware())
    unpaused = Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT], replace(Chain.firmware(), coast_share=0.0))
    columns = record_simulated_drive(weaker, 4.0)
    for name, values in record_simulated_drive(unpaused, 4.0).items():
        np.testing.assert_allclose(values, columns[name], rtol=1e-9, atol=1e-9, err_msg=name)
    asked = [each for each in CAUSES if each.id.startswith(("motor.", "battery.", "friction."))]
    said = diagnose(columns, ROBOT, causes=asked)
    assert [each.name for each in said.causes] == ["motor.armature_resistance"]
    assert any("does not pause for its samples" in each for each in said.notes)


def taken_for(habits: Habits, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make what is found out before any cause is known these habits."""
    monkeypatch.setattr("raccoon.diagnose.habits.habit_search.find_habits", lambda log, *_: (log, habits))


FIRMWARE = Habits(Chain.firmware(), False)
SEVERAL = ("battery.internal_resistance", "bemf.offset@left")
NOTHING_FITTED = FitUncertainty(neutral_settings(ROBOT), (), np.zeros((0, 0)))


def test_the_filter_is_asked_again_once_a_cause_is_known() -> None:
    """Where the habits were taken for the firmware's all the same."""
    dead = Parameters(ROBOT, {("actuation.deadband", None): {"duty": 0.066}}, Chain())
    columns = record_simulated_drive(dead, 6.0, seed=1)
    among = ("actuation.", "bemf.", "friction.coulomb")
    search, trials = standing(columns, FIRMWARE, {"actuation.deadband": 1.0}, among)
    search, habits = try_sensor_chains(search, FIRMWARE, trials)
    assert set(search.fit.point.active) == {"actuation.deadband"}
    assert habits.chain == Chain()


def test_where_nothing_is_named_no_other_filter_is_asked_for() -> None:
    """Wheel loops and a floor that is not alike everywhere: under the firmware's filter with another time
    constant 24 more were explained of a robot that is as robot.toml says."""

    def ask(habits: Habits) -> Problem:
        raise AssertionError(habits)

    search, _ = standing(
        record_simulated_drive(Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT], Chain()), 3.0), FIRMWARE, {}
    )
    assert try_sensor_chains(search, FIRMWARE, HabitTrials(ask)) == (search, FIRMWARE)


def test_the_filter_of_the_battery_is_asked_for_before_that_of_the_wheels() -> None:
    """A sound robot with a plain filter and a slow battery reading had another filter of the wheels, under
    which the battery suited better by chance."""
    order = [each.attempt for each in FIRST_STEPS]
    assert order.index(try_battery_filters) < order.index(try_sensor_chains)


def test_a_habit_under_which_nothing_is_wrong_need_not_be_far_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sound robot whose friction creeps had something unknown over the speed, which is 8 behind."""
    columns = record_simulated_drive(Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT]), 3.0)
    creeps = replace(FIRMWARE, sliding=WheelSliding.CREEPING)
    among = ("friction.viscous", "drive.inertia")
    search, trials = standing(columns, FIRMWARE, {"friction.viscous": 0.5}, among)
    sound, heavy = (standing(columns, creeps, named, among)[0] for named in ({}, {"drive.inertia": 0.5}))
    monkeypatch.setattr("raccoon.diagnose.habits.alternatives.net_lead", lambda *_: MIN_LOG_EVIDENCE_LEAD)
    for second, ahead, other in ((sound, 1.0, True), (sound, -1.0, False), (heavy, 1.0, False)):
        trials.started[creeps] = replace(second, rejections={})
        monkeypatch.setattr(
            "raccoon.diagnose.habits.alternatives.lead_over_search", lambda *_, lead=ahead: lead
        )
        _, habits = adopt_if_ahead(
            replace(search, rejections={}),
            FIRMWARE,
            trials.running(start_selection),
            creeps,
            trials.problem_of(creeps),
            [search.fit.point],
        )
        assert (habits == creeps) is other, ahead


@pytest.mark.parametrize("run_search", [continue_selection, run_search])
def test_habits_are_asked_for_before_a_search_takes_longest(
    run_search: RunSearch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its rest was done under each that was replaced: of a drive with five causes three times."""
    search, trials = standing(
        record_simulated_drive(Parameters(ROBOT, {}), 3.0), FIRMWARE, {"friction.viscous": 0.5}, ["friction."]
    )
    creeps, rests = replace(FIRMWARE, sliding=WheelSliding.CREEPING), []

    def rest(search: Search) -> Search:
        rests.append(search)
        return search

    trials.started[creeps] = replace(search, rejections={})
    monkeypatch.setattr("raccoon.diagnose.habits.alternatives.net_lead", lambda *_: MIN_LOG_EVIDENCE_LEAD)
    monkeypatch.setattr(
        "raccoon.diagnose.habits.alternatives.lead_over_search", lambda *_: MIN_LOG_EVIDENCE_LEAD + 1.0
    )
    monkeypatch.setattr("raccoon.diagnose.habits.alternatives.refine_selection", rest)
    _, habits = adopt_if_ahead(
        search, FIRMWARE, trials.running(run_search), creeps, trials.problem_of(creeps), [search.fit.point]
    )
    assert habits == creeps
    assert len(rests) == (run_search is run_search)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("firmware", [None, FIRMWARES["wombat-raccoon-17"]])
def test_beside_several_causes_habits_are_asked_for_once_more(
    count: int, firmware: Firmware | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of one cause were, when the search had begun; those of a known firmware are not asked for."""
    asked: list[tuple[str, RunSearch]] = []
    point = SimpleNamespace(active=dict.fromkeys(("friction.viscous", "imu.latency")[:count]))
    search = cast(Search, SimpleNamespace(fit=SimpleNamespace(point=point)))

    def step(name: str, *, known_firmware: bool) -> HabitStep:
        def attempt(search: Search, habits: Habits, trials: HabitTrials) -> tuple[Search, Habits]:
            asked.append((name, trials.run_search))
            return search, habits

        return HabitStep(attempt, known_firmware)

    def grown_on(search: Search) -> Search:
        return search

    steps = (step("chain", known_firmware=False), step("friction", known_firmware=True))
    monkeypatch.setattr("raccoon.diagnose.habits.habit_search.GROWN_STEPS", steps)
    monkeypatch.setattr("raccoon.diagnose.habits.habit_search.continue_selection", grown_on)
    habits = replace(FIRMWARE, firmware=firmware)
    assert _grow(search, habits, HabitTrials(lambda _: pytest.fail("asked"))) == (search, habits)
    names = ["friction"] if firmware else ["chain", "friction"]
    assert asked == ([(each, grown_on) for each in names] if count == 2 else [])


def test_late_commands_are_not_a_late_gyro_behind_the_firmwares_median() -> None:
    """The median delays the wheels' readings by nearly as much as the commands are late."""
    late = Parameters(ROBOT, {("actuation.latency", None): {"seconds": 0.008}}, Chain())
    columns = record_simulated_drive(late, 6.0, seed=1)
    among = ("actuation.", "imu.", "bemf.filter_lag", "drive.wheel_slip")
    search, trials = standing(columns, FIRMWARE, {"imu.latency": 0.3}, among)
    search, habits = try_sensor_chains(search, FIRMWARE, trials)
    assert set(search.fit.point.active) == {"actuation.latency"}
    settings = search.problem.settings(search.fit.point)
    assert settings[("actuation.latency", None, "seconds")] == pytest.approx(0.008, abs=0.0005)
    assert habits.chain == Chain()


def test_whether_duty_0_brakes_is_asked_again_once_the_search_is_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    columns = record_simulated_drive(Parameters.from_robot(ROBOT), 12.0, seed=1, brake=True)
    taken_for(Habits(Chain(), False), monkeypatch)
    asked = [each for each in CAUSES if each.id.startswith(("motor.", "friction.", "actuation."))]
    search, habits, _ = search_with_habits(log_from_columns(columns, ROBOT), ROBOT, asked, None)
    assert habits == Habits(Chain(), True)
    assert not search.fit.point.active


def test_beside_several_causes_commands_that_swing_are_compared_over_whole_swings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The program of a robot that follows a line hears of a push before the wheels' readings do, and answers
    it ten times a second."""
    steers = Hidden("unknown", None, {}, {"line_steer": 0.7, "own_cycle": 0.0053, "gyro_smooth": 0.0039})
    log = log_from_columns(make(2, [steers], drive="legs", seconds=12.0).columns, ROBOT)
    known = Habits(FREE_RUNNING, False, low_pass=True)
    taken_for(known, monkeypatch)
    for steps in ("FIRST_STEPS", "GROWN_STEPS", "LAST_STEPS"):
        monkeypatch.setattr(f"raccoon.diagnose.habits.habit_search.{steps}", ())
    for name in ("continue_selection", "refine_selection"):
        monkeypatch.setattr(f"raccoon.diagnose.habits.habit_search.{name}", lambda search: search)
    monkeypatch.setattr("raccoon.diagnose.habits.habit_search.with_lost_changes", lambda log, *_: log)
    asked = [each for each in CAUSES if each.name in SEVERAL]
    for names, seconds in ((SEVERAL, swing_period(log)), (SEVERAL[:1], 0.0)):

        def begun(start: Search, names: tuple[str, ...] = names) -> Search:
            point = start.fit.point
            for each in names:
                point = point.with_cause(each, np.array([1.0]))
            return linearise_search(start.problem, start.probes, point, start.whitener)

        monkeypatch.setattr("raccoon.diagnose.habits.habit_search.start_selection", begun)
        _, habits, _ = search_with_habits(log, ROBOT, asked, None)
        assert habits == replace(known, swing_period=seconds)
    said = habit_notes(replace(known, swing_period=swing_period(log)), (), NOTHING_FITTED)
    assert any("times a second" in each for each in said)


@pytest.mark.parametrize("wheels", [WheelSliding.RIGID, WheelSliding.COMPLIANT])
def test_whether_wheels_give_before_they_slide_is_found_out(wheels: WheelSliding) -> None:
    robot = Parameters(ROBOT, SLIDING[wheels], Chain.firmware())
    _, habits = find_habits(log_from_columns(record_simulated_drive(robot, 12.0), ROBOT), ROBOT, CAUSES, None)
    assert habits == Habits(Chain.firmware(), False, sliding=wheels)


def test_how_wheels_slide_is_asked_again_once_a_cause_is_known() -> None:
    """Where it was taken for the other all the same. Rigid wheels, taken for ones that give, had a fifth of
    their inertia and five times their resistance."""
    heavy: Effects = {("drive.inertia", None): {"factor": 1.4}}
    columns = record_simulated_drive(Parameters(ROBOT, heavy, Chain.firmware()), 14.0)
    first, among = replace(FIRMWARE, sliding=WheelSliding.COMPLIANT), ("drive.inertia", "friction.", "motor.")
    search, trials = standing(columns, first, {"drive.inertia": 0.5}, among)
    search, habits = try_friction_forms(search, first, trials)
    assert habits == replace(FIRMWARE, sliding=WheelSliding.RIGID)
    assert set(search.fit.point.active) == {"drive.inertia"}


@pytest.mark.parametrize("torque", [0.0, 0.08])
def test_friction_that_is_elastic_until_it_breaks_away_is_no_stiction(torque: float) -> None:
    """Taken for bristles that creep, it had a stiction of 0.04 N m; real stiction stays."""
    gives = {"compliance": 0.015, "damping": 0.3, "break_away": 0.9}
    sticks: Effects = {
        ("friction.stiction", side): {"torque": torque, "speed": 0.5} for side in ("left", "right")
    }
    robot = Parameters(ROBOT, sticks | {("friction.presliding", None): gives}, Chain.firmware())
    quiet = dict.fromkeys(("motor.0.bemf", "motor.1.bemf"), 1.5)
    columns = record_simulated_drive(robot, 6.0, softened=80, noise=quiet)
    search, trials = standing(columns, FIRMWARE, {"friction.stiction": (0.5, 0.0)}, ["friction.stiction"])
    search, habits = try_friction_forms(search, FIRMWARE, trials.running(start_selection))
    assert habits == replace(FIRMWARE, sliding=WheelSliding.ELASTO_PLASTIC)
    settings = search.problem.settings(search.fit.point)
    for name, size in gives.items():
        assert settings[("friction.presliding", None, name)] == pytest.approx(size, rel=0.2), name
    assert settings[("friction.stiction", "left", "torque")] == pytest.approx(torque, abs=0.01)


def test_a_beginning_is_searched_once_and_handed_out_as_it_was(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Search] = []

    def begun(start: Search) -> Search:
        made.append(start)
        return start

    monkeypatch.setattr("raccoon.diagnose.habits.trials.start_selection", begun)
    monkeypatch.setattr(
        "raccoon.diagnose.habits.trials.start_afresh", lambda its: search_at(its, its.nominal())
    )
    trials = HabitTrials(lambda _: problem)
    one = trials.start(FIRMWARE, problem)
    one.rejections["drive.inertia"] = "explains too little"
    one.leads["drive.inertia"] = one.held_out_leads["drive.inertia"] = 3.0  # as one that goes on with it does
    other = trials.start(FIRMWARE, problem)
    assert [*other.rejections, *other.leads, *other.held_out_leads] == []
    assert len(made) == 1
    others = [replace(FIRMWARE, swing_period=0.1 * each) for each in range(1, MAX_CACHED_STARTS + 1)]
    for each in (*others, others[0], FIRMWARE):  # which the last of the others took the place of
        trials.start(each, problem)
    assert len(made) == 1 + MAX_CACHED_STARTS + 1


def test_a_beginning_that_ended_far_behind_with_the_same_cause_is_not_gone_on_with(problem: Problem) -> None:
    measured = problem.predict([problem.nominal()])[0]
    driven = replace(problem, features=replace(problem.features, measured=measured))

    def search(name: str, u: float) -> Search:
        return search_at(driven, driven.nominal().with_cause(name, np.array([u])))

    found = search("drive.inertia", 0.0)
    near, far = (lead_over_search(search("drive.inertia", u), found) for u in (0.01, 1.0))
    assert -MIN_LOG_EVIDENCE_LEAD < near < MIN_LOG_EVIDENCE_LEAD < 2.0 * MIN_LOG_EVIDENCE_LEAD < -far
    assert _ended_far_behind(search("drive.inertia", 1.0), found, 0.0)
    assert not _ended_far_behind(search("drive.inertia", 1.0), found, far)
    assert not _ended_far_behind(search("drive.inertia", 0.01), found, 0.0)
    assert not _ended_far_behind(search("motor.back_emf_constant", 1.0), found, 0.0)


@pytest.mark.parametrize(
    ("named", "there", "ahead", "behind"),
    [
        (CROWDED_CAUSES, CROWDED_CAUSES, -1.0, True),
        (CROWDED_CAUSES, CROWDED_CAUSES, 1.0, False),
        (CROWDED_CAUSES, CROWDED_CAUSES - 1, -1.0, False),
        (CROWDED_CAUSES, 2, -HOPELESS_DEFICIT - 1.0, True),
        (CROWDED_CAUSES - 1, CROWDED_CAUSES, -HOPELESS_DEFICIT - 1.0, False),
    ],
)
def test_beside_a_crowd_what_explains_less_under_other_habits_is_not_gone_on_with(
    named: int, there: int, ahead: float, behind: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twelve causes on 36 s had grown under others to ten that lacked 214: going on from these, and from
    something unknown after them, took longer than all before. Eleven had to eight that lacked 165."""

    def search(count: int) -> Any:
        point = Point(np.zeros(0), {f"own.{number}": np.ones(1) for number in range(count)})
        return SimpleNamespace(fit=SimpleNamespace(point=point))

    monkeypatch.setattr("raccoon.diagnose.habits.alternatives.lead_over_search", lambda *_: ahead)
    assert _grown_crowded_and_behind(search(there), search(named)) is behind


def test_the_likeliest_of_several_starts_is_fitted_as_if_it_were_the_only_one() -> None:
    heavy: Effects = {("drive.inertia", None): {"factor": 1.4}}
    log = log_from_columns(
        record_simulated_drive(Parameters(ROBOT, heavy | SLIDING[WheelSliding.COMPLIANT]), 10.0), ROBOT
    )
    gives, slides = (
        drive_problem(log, ROBOT, CAUSES, Habits(Chain(), False, sliding=wheels), None)
        for wheels in (WheelSliding.COMPLIANT, WheelSliding.RIGID)
    )
    nothing = gives.nominal()
    starts = [nothing.with_cause("actuation.latency", np.array([0.3])), nothing]
    right = nothing.with_cause("drive.inertia", np.array([0.5]))
    search = start_afresh(gives)
    found = fit_best_start(search, slides, [*starts, right])
    alone = fit_best_start(search, slides, [right])
    assert set(found.point.active) == {"drive.inertia"}
    assert found.cost == pytest.approx(
        alone.cost, abs=2.0 * ROUGH_DECREASE
    )  # each stops where no step gains as much
    np.testing.assert_allclose(
        found.point.active["drive.inertia"], alone.point.active["drive.inertia"], rtol=0.1
    )


@pytest.mark.parametrize("cause", ["drive.inertia", "imu.latency"])
def test_habits_that_are_far_behind_are_given_up_with_the_columns_that_are_known(
    cause: str, simulated: list[int]
) -> None:
    """The simulator's filter is none that a start with the search's cause, or with another one, makes up
    for."""
    heavy: Effects = {("drive.inertia", None): {"factor": 1.4}}
    robot = Parameters(ROBOT, heavy | SLIDING[WheelSliding.COMPLIANT], Chain.firmware())
    log = log_from_columns(record_simulated_drive(robot, 20.0), ROBOT)
    asked = [each for each in CAUSES if each.id in ("drive.inertia", "imu.latency")]
    right, wrong = (
        drive_problem(log, ROBOT, asked, Habits(chain, False), None) for chain in (Chain.firmware(), Chain())
    )
    start = start_afresh(right)
    inertia = start.fit.point.with_cause("drive.inertia", np.array([0.5]))
    search = linearise_search(
        right, start.probes, fit_best_start(start, right, [inertia]).point, start.whitener
    )
    point = start.fit.point.with_cause(cause, np.array([0.5]))
    simulated.append(0)
    assert log_evidence_lead(search, wrong, [point]) < -HOPELESS_DEFICIT
    assert simulated[-1] < len(wrong.base)


def test_a_point_carried_to_other_habits_keeps_the_numbers_that_both_have() -> None:
    log = planned_log(exciting(np.random.default_rng(1), 2.0))
    gives, slides = (
        drive_problem(log, ROBOT, CAUSES, Habits(Chain(), False, sliding=wheels), None)
        for wheels in (WheelSliding.COMPLIANT, WheelSliding.RIGID)
    )
    rng = np.random.default_rng(2)
    point = gives.inside(Point(rng.standard_normal(len(gives.base)), {"drive.inertia": np.array([0.3])}))
    there = transfer_point(point, gives, slides)
    assert (
        slides.settings(there).items()
        >= {
            key: value for key, value in gives.settings(point).items() if key[0] != "friction.presliding"
        }.items()
    )
    columns = transfer_columns(point.vector()[:, None], gives, slides)
    assert columns is not None
    np.testing.assert_array_equal(columns[:, 0], there.vector())
    assert transfer_columns(columns, slides, gives) is None
    back = transfer_point(there, slides, gives)
    lost = [each.settings[0][0] == "friction.presliding" for each in gives.base]
    np.testing.assert_array_equal(back.base, np.where(lost, 0.0, point.base))
    assert back.active == point.active


def test_a_point_carried_to_habits_that_leave_more_open_keeps_its_times_and_how_readings_follow() -> None:
    """A clock of its own leaves three times as much open of the filter, and five times of the latency: 1 ms
    late was 0.2 ms late in step."""
    log = planned_log(exciting(np.random.default_rng(1), 2.0))
    steps, runs = (
        drive_problem(log, ROBOT, CAUSES, Habits(chain, False), None)
        for chain in (Chain.firmware(), FREE_RUNNING)
    )
    late = ("actuation.latency", None, "seconds")
    (index,) = (index for index, each in enumerate(runs.base) if each.settings == (late,))
    point = replace(runs.nominal(), base=0.5 * np.eye(len(runs.base))[index])
    there = transfer_point(point, runs, steps)
    assert runs.settings(point)[late] == pytest.approx(0.00074, abs=1e-5)
    assert steps.settings(there) == pytest.approx(runs.settings(point))
    columns = transfer_columns(np.eye(len(runs.base)), runs, steps)
    assert columns is not None  # as much as a point is carried by, its columns change the readings by less
    np.testing.assert_allclose(there.base @ columns, point.base)
    far = transfer_point(replace(point, base=6.0 * point.base), runs, steps)
    assert steps.settings(far)[late] == pytest.approx(MAX_BASE_STDS * LOOP_LATENCY)


@pytest.mark.parametrize(("cause", "named"), [(None, "friction.load_dependent"), ("drive.inertia",) * 2])
def test_commands_that_were_in_force_until_their_rows_are_no_fault(cause: str | None, named: str) -> None:
    """A logger that writes what it has just done, beside readings of now."""
    hidden = [] if cause is None else [draw(cause, np.random.default_rng(3))]
    columns = dict(make(4, hidden, seconds=8.0).columns)
    for name in ("motor.0.duty", "motor.1.duty"):
        columns[name] = np.concatenate([columns[name][:1], columns[name][:-1]])
    among = ("drive.inertia", "friction.load", "friction.coulomb", "actuation.", "imu.latency")
    search, trials = standing(columns, FIRMWARE, {named: 0.4}, among)
    search, habits = try_commands_until_row(search, FIRMWARE, trials)
    assert list(search.fit.point.active) == [each.name for each in hidden]
    assert habits == replace(FIRMWARE, commands_precede_rows=True)


def test_a_logger_of_what_was_done_is_said() -> None:
    assert habit_notes(replace(FIRMWARE, commands_precede_rows=True), (), NOTHING_FITTED) == (
        COMMAND_IN_FORCE_BEFORE,
    )
    assert habit_notes(FIRMWARE, (), NOTHING_FITTED) == ()


@pytest.mark.parametrize(("cause", "named"), [(None, "battery.internal_resistance"), ("drive.inertia",) * 2])
def test_a_slow_filter_of_the_battery_is_no_fault_of_the_battery(cause: str | None, named: str) -> None:
    """As RaccoonOS has it: 0.05 of each new reading."""
    hidden = [] if cause is None else [draw(cause, np.random.default_rng(3))]
    columns = dict(make(4, hidden, seconds=8.0).columns)
    slow = columns["battery.voltage"].copy()
    new = np.flatnonzero(np.isfinite(slow))
    for before, now in pairwise(new):
        slow[now] = 0.95 * slow[before] + 0.05 * slow[now]
    columns["battery.voltage"] = slow
    search, trials = standing(columns, FIRMWARE, {named: -0.4}, ("drive.inertia", "battery.", "motor."))
    search, habits = try_battery_filters(search, FIRMWARE, trials)
    assert list(search.fit.point.active) == [each.name for each in hidden]
    assert habits.chain.battery_time_constant == 0.2  # of readings every 10 ms
    (said,) = habit_notes(habits, (), NOTHING_FITTED)
    assert said.startswith("the battery's reading has a filter of 0.2 s")


@pytest.mark.parametrize("itself", [True, False])
def test_a_csv_may_filter_the_battery_more_than_the_firmware_that_robot_toml_names(itself: bool) -> None:
    """A sound robot had a battery of a third of its resistance, with a probability of 1."""
    firmware = replace(FIRMWARES["wombat-raccoon-17"], is_named_by_recording=itself)
    chain = replace(firmware.chain, battery_time_constant=0.1)
    log = log_from_columns(
        record_simulated_drive(Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT], chain), 8.0), ROBOT
    )
    _, habits = find_habits(log, ROBOT, CAUSES, None, firmware)
    assert habits.chain == (firmware.chain if itself else chain)


def test_the_firmware_s_filter_of_the_battery_is_asked_for_under_another_of_the_wheels() -> None:
    chain = Chain(median=True, battery_time_constant=0.02)
    weak: Effects = {("motor.armature_resistance", "left"): {"factor": 1.2}}
    slow = Habits(replace(chain, battery_time_constant=0.05), brake=False)
    columns = record_simulated_drive(Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT] | weak, chain), 8.0)
    among = ("motor.armature", "battery.", "bemf.filter_lag", "actuation.latency")
    search, trials = standing(columns, slow, {"motor.armature_resistance@left": 0.8}, among)
    search, habits = try_battery_filters(search, slow, trials)
    assert habits.chain == chain
    assert list(search.fit.point.active) == ["motor.armature_resistance@left"]


def test_a_clock_is_asked_for_behind_a_quick_filter_of_the_battery() -> None:
    """Between none and the firmware's neither fits, and a pause at the end of a row with a latency did."""
    chain = replace(FREE_RUNNING, battery_time_constant=0.005)
    columns = record_simulated_drive(Parameters(ROBOT, SLIDING[WheelSliding.COMPLIANT], chain), 8.0)
    seen = Habits(PAUSING_AT_CYCLE_END, brake=False)
    among = ("battery.", "bemf.filter_lag", "actuation.latency", "imu.latency")
    search, trials = standing(columns, seen, {"actuation.latency": 0.25}, among)
    search, habits = try_lagging_readings(search, seen, trials)
    assert habits.chain == chain
    assert list(search.fit.point.active) == []


def test_commands_from_their_rows_on_are_taken_so() -> None:
    columns = make(4, [draw("actuation.latency", np.random.default_rng(3))], seconds=6.0).columns
    among = ("actuation.", "imu.latency", "bemf.filter_lag")
    search, trials = standing(columns, FIRMWARE, {"actuation.latency": 0.4}, among)
    search, habits = try_commands_until_row(search, FIRMWARE, trials)
    assert list(search.fit.point.active) == ["actuation.latency"]
    assert not habits.commands_precede_rows


@pytest.mark.parametrize(
    ("row", "cycle"), [(0.005, 0.005), (0.02, 0.005), (0.0042, 0.0042), (0.011, 0.0055), (0.001, 0.005)]
)
def test_a_row_is_a_whole_number_of_the_controllers_cycles(row: float, cycle: float) -> None:
    log = planned_log(exciting(np.random.default_rng(1), 2.0))
    shaken = row * (np.arange(len(log.time)) + np.random.default_rng(2).uniform(-0.05, 0.05, len(log.time)))
    assert _controller_cycle(median_step(shaken), 0.005) == pytest.approx(cycle, rel=0.02)


def test_wheels_that_are_filtered_once_a_row_have_no_other_filter() -> None:
    """A filter two thirds as slow was named of a simulation in rows of 20 ms, and the rest called unknown."""
    row = 0.02
    robot = replace(ROBOT, controller=replace(ROBOT.controller, rate_hz=1.0 / row))
    said = diagnose(record_simulated_drive(Parameters(robot, {}, Chain(cycle=row)), 16.0, row=row), robot)
    assert said.verdict is Verdict.ADEQUATE
    assert said.causes == ()


def test_rows_of_several_cycles_are_taken_for_that() -> None:
    """As a program logs that reads a firmware's filter at 100 Hz."""
    columns = {
        name: each[::2] for name, each in record_simulated_drive(Parameters(ROBOT, {}, Chain()), 16.0).items()
    }
    _, habits = find_habits(log_from_columns(columns, ROBOT), ROBOT, drive_causes(), None)
    assert habits.chain.cycle == 0.005
