from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import draw
from raccoon.core.config import RobotConfig
from raccoon.diagnose import diagnosis as diagnosing
from raccoon.diagnose.diagnosis import Diagnoser, _other_robot_notes, diagnose
from raccoon.diagnose.drives.features import BIN_S
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.findings import validation
from raccoon.diagnose.findings.cause_results import fitted_parameters
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.fleet.summary import fleet_of
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.hypotheses.base_coordinates import PRESLIDING, base_coordinates
from raccoon.diagnose.hypotheses.cause_catalogue import NUISANCE_EFFECTS, drive_causes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.reports.cause_text import explanation_sentence
from raccoon.diagnose.reports.fleet_text import fleet_report
from raccoon.diagnose.reports.manoeuvre_text import manoeuvre_for
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import SAME_ROBOT, Diagnosis, ParameterResult, Verdict
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.rollout.simulated_robot import to_parameters
from raccoon.diagnose.search_outcome import SearchOutcome, _verdict
from raccoon.diagnose.select.state import linearise_search
from raccoon.diagnose.unknown.probes import FRICTION_OVER_TIME
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import all_effects, effect
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from simulated_drives import BLIND_CONTROLLER
from unit.diagnose.searches import searched

ROBOT = RobotConfig()


@pytest.fixture(scope="module")
def sagging() -> Diagnosis:
    hidden = draw("battery.internal_resistance", np.random.default_rng(8))
    columns = dict(make(8, [hidden], seconds=10.0).columns)
    causes = [each for each in drive_causes() if each.id.startswith(("battery.", "motor."))]
    return diagnose(columns, ROBOT, causes=causes, firmware=BLIND_CONTROLLER)


def test_what_is_judged_on_has_bins_as_long_as_what_was_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop's commands made them a quarter as long, and their noise was held against that of 20 ms."""
    duty = np.tile(np.linspace(0.2, 0.3, 7)[:, None], (120, 2))
    fitted, unseen = (
        log_from_columns(make(3, drive=each).columns, ROBOT) for each in (0.0 * duty + 0.3, duty)
    )
    habits, seen = Habits(Chain.firmware(), False), list[Problem]()

    def found(log: Log, *_: object) -> tuple[Any, Habits, Log]:
        problem = drive_problem(log, ROBOT, (), habits, None)
        return SimpleNamespace(problem=problem, fit=SimpleNamespace(point=problem.nominal())), habits, log

    def judged(_: object, other: Problem) -> None:
        seen.append(other)
        raise StopIteration

    monkeypatch.setattr(diagnosing, "search_with_habits", found)
    monkeypatch.setattr(diagnosing, "validate_causes", judged)
    with pytest.raises(StopIteration):
        Diagnoser(ROBOT, (), None, None, 0.0).search_once(fitted, unseen)
    assert seen[0].features.width == BIN_S
    assert drive_problem(unseen, ROBOT, (), habits, None).features.width < BIN_S


@pytest.mark.parametrize(
    ("causes", "unknown", "left", "far", "verdict"),
    [
        (True, False, 0.0, False, Verdict.EXPLAINED),
        (True, False, 1.0, True, Verdict.PARTLY),  # all that is beyond chance is left
        (True, True, 0.0, False, Verdict.PARTLY),
        (False, True, 1.0, True, Verdict.UNKNOWN),
        (False, False, 1.0, True, Verdict.UNKNOWN),
        (False, False, 0.0, False, Verdict.ADEQUATE),
    ],
)
def test_the_one_word_is_of_what_was_named_and_of_what_is_left(
    causes: bool, unknown: bool, left: float, far: bool, verdict: Verdict
) -> None:
    assert _verdict(causes, unknown, left, far) is verdict


@pytest.mark.parametrize(
    ("named", "before", "after", "said"),
    [
        (True, 2.0, 1.2, ""),
        (True, 1.5, 1.6, "the better model is off by 1.60 times the noise, and robot.toml's by 1.50"),
        (True, 9.0, 6.5, "the better model is off by 6.50 times the noise, and robot.toml's by 9.00"),
        (False, 2.0, 2.0, "the simulation is off by 2.00 times the noise, and nothing was found in this one"),
        (False, 1.2, 1.2, ""),
    ],
)
def test_a_recording_of_another_robot_proves_no_cause(
    named: bool, before: float, after: float, said: str
) -> None:
    """Of which the better model is no better, or far off; or robot.toml, where nothing was found."""
    found: Any = SimpleNamespace(causes=(1,) * named, unexplained=SimpleNamespace(depends_on=()))
    judged: Any = SimpleNamespace(size_before=before, size_after=after, is_model_wrong=after > 1.5)
    told = "".join(_other_robot_notes(found, judged))
    assert told == (f"on the other recording {said}: {SAME_ROBOT}" if said else "")


@pytest.mark.parametrize(("depends_on", "times"), [("", 2), ("position x", 2), ("position x", 3)])
def test_what_happened_in_a_moment_is_left_out_and_asked_again(
    monkeypatch: pytest.MonkeyPatch, depends_on: str, times: int
) -> None:
    """What adds up all ways is told by the longest part without the moment, where it is long enough."""
    columns = dict(make(8, seconds=12.0 if times == 2 else 20.0).columns)
    found = SimpleNamespace(causes=(), channels=(), unexplained=SimpleNamespace(depends_on=(depends_on,)))
    logs: list[Any] = []

    def once(_: Diagnoser, log: Any, __: Any) -> SearchOutcome:
        logs.append(log)
        said: Any = SimpleNamespace(**vars(found), asked=len(logs))
        return SearchOutcome(said, (5.0,) if len(logs) == 1 else ())

    monkeypatch.setattr(Diagnoser, "search_once", once)
    said: Any = diagnose(columns, ROBOT)
    assert len(logs) == times
    assert not logs[0].lost
    ((start, _),) = logs[1].lost
    assert start == pytest.approx(4.4)
    assert said.asked == (1 if depends_on and times == 2 else times)


@pytest.mark.parametrize(
    ("cause", "left", "clear", "later", "asked"),
    [
        ("friction.coulomb", 1.2, False, "", 1),
        ("motor.heating", 1.2, False, FRICTION_OVER_TIME, 2),
        ("motor.heating", 1.2, True, "", 1),
        ("motor.heating", 2.0, True, FRICTION_OVER_TIME, 2),
        ("motor.heating", 1.2, False, "speed", 2),
        ("friction.coulomb", 2.0, False, FRICTION_OVER_TIME, 2),
    ],
)
def test_friction_over_time_is_asked_for_where_it_may_have_changed(
    monkeypatch: pytest.MonkeyPatch, cause: str, left: float, clear: bool, later: str, asked: int
) -> None:
    """And kept where it is what the drive depends on. Of motors that are clearly hot it is not asked for,
    unless the wheels are far off."""
    channel = SimpleNamespace(name="motor.0.bemf", rmse_after=left, noise_floor=1.0)
    logs: list[Any] = []

    def once(_: Diagnoser, log: Any, __: Any) -> SearchOutcome:
        logs.append(log)
        causes = (SimpleNamespace(id=cause),) if len(logs) == 1 else ()
        unexplained = SimpleNamespace(depends_on=(later,) if len(logs) > 1 else ())
        said: Any = SimpleNamespace(causes=causes, channels=(channel,), unexplained=unexplained)
        return SearchOutcome(said, (), is_heating=lambda: clear)

    monkeypatch.setattr(Diagnoser, "search_once", once)
    said: Any = diagnose(dict(make(8, seconds=8.0).columns), ROBOT)
    assert [each.friction_may_change for each in logs] == [False, True][:asked]
    assert said.unexplained.depends_on == ((FRICTION_OVER_TIME,) if later == FRICTION_OVER_TIME else ())


def test_the_json_has_the_contract_keys(sagging: Diagnosis, tmp_path: Path) -> None:
    sagging.save_json(tmp_path / "out.json")
    read = json.loads((tmp_path / "out.json").read_text())
    assert list(read) == [
        "verdict", "channels", "causes", "rejected", "unexplained", "suggested_manoeuvres", "seconds",
        "notes",
    ]  # fmt: skip
    assert set(read["causes"][0]) == {
        "id", "where", "rank", "parameters", "gain", "probability", "confounded_with", "explanation",
        "change", "unabsorbed",
    }  # fmt: skip
    assert set(read["causes"][0]["parameters"]["resistance"]) == {"value", "std", "unit", "nominal"}
    assert set(read["channels"][0]) == {
        "name", "unit", "rmse_before", "rmse_after", "noise_floor", "whiteness_p",
    }  # fmt: skip


def test_the_report_says_it_in_words(sagging: Diagnosis) -> None:
    text = terminal_report(sagging)
    assert "battery's resistance" in text
    assert "ohm" in text


def test_the_model_has_the_cause_and_survives_its_file(sagging: Diagnosis, tmp_path: Path) -> None:
    assert sagging.model is not None
    sagging.model.save(tmp_path / "model.toml")
    again = Parameters.from_model_file(tmp_path / "model.toml")
    found = sagging.causes[0].parameters["resistance"].value
    assert again.value("battery.internal_resistance", "resistance") == pytest.approx(found)


def test_the_model_says_how_sure_each_number_is_and_why_it_is_there(sagging: Diagnosis) -> None:
    assert sagging.model is not None
    (cause,) = sagging.causes
    origins = sagging.model.origins
    assert set(origins) == set(sagging.model.effects)
    named = origins[("battery.internal_resistance", None)]
    assert named.std == {"resistance": cause.parameters["resistance"].std}
    assert cause.explanation in named.source
    assert named.probability == cause.probability
    refitted = origins[("motor.back_emf_constant", "left")]
    assert 0.0 < refitted.std["factor"] < ROBOT.model.left.back_emf_constant.std / 1.08
    assert "robot.toml" in refitted.source
    drive, nominal = sagging.model.robot.model.drive, ROBOT.model.drive
    assert 0.0 < drive.inertia_straight.std < nominal.inertia_straight.std


def test_a_gap_that_no_sample_tells_from_a_wider_one_is_not_as_unsure_as_before() -> None:
    """Without slip a wheel forgets when it met the tooth, so only samples inside the gap tell its width."""
    robot = Parameters.from_robot(ROBOT).with_effect("drive.backlash", angle=0.06, coasting=0.006)
    duty = np.where(np.arange(1600) * 0.005 % 1.0 < 0.5, 0.5, -0.5)
    time = np.arange(len(duty)) * 0.005
    out = rollout(robot, Commands.of_wheels(time, -duty, duty), longest_step=0.001)
    rng = np.random.default_rng(5)
    columns = {"t": time, "motor.0.duty": -duty, "motor.1.duty": duty}
    noise = {"motor.0.bemf": 4.0, "motor.1.bemf": 4.0, "imu.gyro.z": 0.005, "battery.voltage": 0.01}
    for name, sd in noise.items():
        columns[name] = out[name][0] + sd * rng.standard_normal(len(time))
    play = [each for each in drive_causes() if each.id == "drive.backlash"]
    (cause,) = diagnose(columns, ROBOT, causes=play).causes
    angle = cause.parameters["angle"]
    assert angle.std < 0.025  # the prior's is 0.1
    assert abs(angle.value - 0.06) < 2.0 * angle.std


def test_what_both_wheels_have_unlike_is_said_of_each(problem: Problem) -> None:
    """Said of both and of the left one beside it, both had the left one's number, the right one's none."""
    friction = {name: each for name, each in problem.causes.items() if each.id == "friction.coulomb"}
    asked, truth, torques = replace(problem, causes=friction), problem.nominal(), {}
    for side, size in (("left", 0.6), ("right", -0.7)):
        name, settings = f"friction.coulomb@{side}", dict(problem.neutral)
        truth = truth.with_cause(name, np.array([size]))
        friction[name].apply(settings, [size])
        torques[name] = settings["friction.coulomb", side, "torque"]
    named = problem.nominal()
    for name in ("friction.coulomb", "friction.coulomb@left"):
        named = named.with_cause(name, np.zeros(1))
    begun = searched(asked, truth, named)
    fit = fit_point(begun.problem, begun.whitener, named)
    stood = linearise_search(begun.problem, begun.probes, fit.point, begun.whitener)
    found, _ = validation.validate_causes(stood, None)
    assert set(found.fit.point.active) == set(torques)
    uncertainty = FitUncertainty.of(found)
    for name, torque in torques.items():
        number = fitted_parameters(found, friction[name], uncertainty)["torque"]
        assert abs(number.value - torque) < 2.0 * number.std


def test_every_drive_effect_is_a_cause_with_a_sentence_and_a_manoeuvre() -> None:
    causes = {each.id for each in drive_causes()}
    for each in all_effects():
        if each.group == "tophat" or each.id in NUISANCE_EFFECTS:
            assert each.id not in causes
            continue
        assert each.id in causes
        assert manoeuvre_for(each.id) is not None


def test_neutral_coordinates_give_the_nominal_robot_whose_wheels_give_as_usual() -> None:
    settings = neutral_settings(ROBOT)
    for coordinate in base_coordinates(ROBOT):
        coordinate.apply(settings, 0.0)
    for cause in drive_causes():
        if cause.joint is None:
            cause.apply(settings, [0.0] * cause.size)
    usual = {("friction.presliding", None, name): value for name, value in PRESLIDING.items()}
    assert settings == pytest.approx({**neutral_settings(ROBOT), **usual})
    assert to_parameters(neutral_settings(ROBOT), neutral_settings(ROBOT), ROBOT, Chain()).effects == {}


def test_a_fleet_tells_common_from_odd(sagging: Diagnosis) -> None:
    clean = Diagnosis(Verdict.ADEQUATE, (), (), sagging.rejected, sagging.unexplained, (), 0.1)
    fleet = fleet_of({"one": sagging, "two": sagging, "three": clean})
    causes = fleet.causes
    assert causes[0].name == "battery.internal_resistance"
    assert causes[0].common
    assert causes[0].recordings == ("one", "two")
    assert "67 % (common)" in fleet_report(fleet)


@pytest.mark.parametrize(("where", "place"), [(None, "at both wheels is"), ("left", "at the left wheel is")])
def test_a_cause_is_said_where_it_is(where: str | None, place: str) -> None:
    values = {"torque": ParameterResult(0.23, 0.004, "N m", 0.18)}
    assert place in explanation_sentence("friction.coulomb", where, values)


@pytest.mark.parametrize(("lag", "name"), [("drive.wheel_slip", "time"), ("imu.latency", "seconds")])
def test_what_play_is_taken_for_says_to_look_for_play(lag: str, name: str) -> None:
    """Play of 0.07 rad of a wheel that rolls on was a gyro 14.8 ms late, and drivers were to plan ahead."""
    said = explanation_sentence(lag, None, {name: ParameterResult(0.0148, 0.0014, "s", 0.0)})
    assert "14.8 ms" in said
    assert "turn each wheel by hand, since play in the gears" in said


@pytest.mark.parametrize(
    ("std", "said"), [(0.0032, "6.2 ms"), (0.00032, "6.18 ms"), (0.0, "6.18 ms"), (0.032, "6 ms")]
)
def test_a_lag_is_said_as_far_as_it_is_known(std: float, said: str) -> None:
    """Readings of 0.0062 +- 0.0032 s came "6.18 ms late"."""
    late = {"seconds": ParameterResult(0.00618, std, "s", 0.0)}
    assert f"Gyro readings come {said} late" in explanation_sentence("imu.latency", None, late)


def test_a_slip_says_that_a_gyro_which_a_program_smooths_looks_the_same() -> None:
    """Of a sound robot whose log smooths it the wheels slipped by 47 ms, with a probability of 1."""
    said = explanation_sentence("drive.wheel_slip", None, {"time": ParameterResult(0.047, 0.001, "s", 0.0)})
    assert "smooths the gyro's readings by as much, that looks the same and is no slip" in said


def test_an_explanation_carries_its_number(sagging: Diagnosis) -> None:
    values = sagging.causes[0].parameters
    text = explanation_sentence("battery.internal_resistance", None, values)
    assert f"{values['resistance'].value:.3f} ohm" in text


@pytest.mark.parametrize(
    ("error", "gain", "elsewhere", "expected", "dropped"),
    [
        (0.8, 300.0, False, 0.9, True),
        (0.8, 300.0, False, 1.1, False),
        (0.8, 9.0, False, 1.1, True),
        (0.95, 9.0, False, 0.9, False),
        (0.8, 300.0, True, 0.9, False),
        (0.8, 9.0, True, 0.9, True),
    ],
)
def test_what_makes_unseen_data_worse_is_dropped(
    error: float,
    gain: float,
    elsewhere: bool,
    expected: float,
    dropped: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However clear it is in the data it was fitted on, where the error is larger than one expects; another
    recording may be of another floor."""
    steps: list[str] = []

    def pruned(search: SimpleNamespace, name: str, why: str) -> SimpleNamespace:
        steps.append(name)
        return SimpleNamespace(leads={each: its for each, its in search.leads.items() if each != name})

    def judged(search: SimpleNamespace, other: object) -> SimpleNamespace:
        without = {"imu.latency": 3.0, "friction.stiction": error}
        left = {each: without[each] for each in search.leads}
        return SimpleNamespace(harm_limit=0.9, size_after=1.0, size_expected=expected, without=left)

    monkeypatch.setattr(validation, "_drop_unneeded", lambda search: search)
    monkeypatch.setattr(validation, "refit_with_final_noise", lambda search: search)
    monkeypatch.setattr(validation, "split_sides", lambda search: search)
    monkeypatch.setattr(validation, "add_missed_cause", lambda _: None)
    monkeypatch.setattr(validation, "prune_cause", pruned)
    monkeypatch.setattr(validation, "evaluate_held_out", judged)
    start: Any = SimpleNamespace(leads={"imu.latency": 50.0, "friction.stiction": gain})
    another: Any = object() if elsewhere else None
    search, _ = validation.validate_causes(start, another)
    assert steps == (["friction.stiction"] if dropped else [])
    assert ("friction.stiction" in search.leads) is not dropped


def test_a_cause_whose_number_is_none_is_not_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slip of 0.5 +- 0.8 ms beside a friction; a resistance that is off by 1.8 of its deviations may be."""
    numbers = {
        "drive.wheel_slip": {"time": ParameterResult(0.0005, 0.0008, "s", 0.0)},
        "motor.armature_resistance": {"factor": ParameterResult(0.91, 0.05, "", 1.0)},
        "friction.coulomb": {"torque": ParameterResult(0.156, 0.005, "N m", 0.18)},
    }

    def pruned(search: Any, name: str, why: str, _: None) -> SimpleNamespace:
        search.rejections[name] = why
        return searching(
            {each: u for each, u in search.fit.point.active.items() if each != name}, search.rejections
        )

    def searching(active: dict[str, float], failed: dict[str, str]) -> SimpleNamespace:
        causes = {name: SimpleNamespace(name=name, effect=effect(name)) for name in numbers}
        fit = SimpleNamespace(point=SimpleNamespace(active=active))
        problem = SimpleNamespace(causes=causes)
        return SimpleNamespace(fit=fit, problem=problem, rejections=failed, leads={})

    monkeypatch.setattr(validation, "refit_with_final_noise", lambda search: search)
    monkeypatch.setattr(validation, "split_sides", lambda search: search)
    monkeypatch.setattr(validation, "find_unneeded_cause", lambda _: None)
    monkeypatch.setattr(validation, "prune_cause", pruned)
    monkeypatch.setattr(validation, "fitted_parameters", lambda _, cause, __: numbers[cause.name])
    monkeypatch.setattr(FitUncertainty, "of", lambda _: None)
    start: Any = searching(dict.fromkeys(numbers, 1.0), {})
    found = validation._drop_unneeded(start)
    assert set(found.fit.point.active) == {"motor.armature_resistance", "friction.coulomb"}
    assert set(found.rejections) == {"drive.wheel_slip"}


def test_what_takes_up_a_cause_without_a_number_may_be_it_in_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gyro 1.0 +- 0.6 ms late beside a slip of 1.4 +- 1.0 ms, and of 2.0 +- 0.2 ms without it; a gyro's
    scale had no number either, and has none without it."""
    stds = {"imu.latency": 0.0006, "drive.wheel_slip": 0.001, "imu.gyro_scale": 0.002}
    values = {"imu.latency": 0.001, "drive.wheel_slip": 0.0014, "imu.gyro_scale": 1.003}

    def parameters(search: Any, cause: Any, _: None) -> dict[str, ParameterResult]:
        (name, *_more) = (each.name for each in cause.effect.parameters)
        alone = "drive.wheel_slip" not in search.fit.point.active and cause.name == "imu.latency"
        std = 0.0002 if alone else stds[cause.name]
        return {name: ParameterResult(values[cause.name], std, "", float(cause.name == "imu.gyro_scale"))}

    def searching(names: list[str]) -> Any:
        causes = {name: SimpleNamespace(name=name, effect=effect(name)) for name in values}
        fit = SimpleNamespace(point=SimpleNamespace(active=dict.fromkeys(names, 1.0)))
        return SimpleNamespace(fit=fit, problem=SimpleNamespace(causes=causes), leads={}, rivals={})

    def pruned(search: Any, name: str, why: str, _: None) -> Any:
        left = searching([each for each in search.fit.point.active if each != name])
        left.rivals = search.rivals
        return left

    monkeypatch.setattr(validation, "refit_with_final_noise", lambda search: search)
    monkeypatch.setattr(validation, "find_unneeded_cause", lambda _: None)
    monkeypatch.setattr(validation, "prune_cause", pruned)
    monkeypatch.setattr(validation, "fitted_parameters", parameters)
    monkeypatch.setattr(FitUncertainty, "of", lambda _: None)
    found = validation._drop_unneeded(searching(list(values)))
    assert set(found.fit.point.active) == {"imu.latency"}
    (rival,) = found.rivals["imu.latency"]
    assert (rival.name, rival.beside) == ("drive.wheel_slip", True)


@pytest.mark.parametrize(("gain", "stands"), [(47.0, True), (20.0, False)])
def test_a_lone_cause_that_is_clear_stands_however_flat_the_misfit_is_there(
    monkeypatch: pytest.MonkeyPatch, gain: float, stands: bool
) -> None:
    """Play of 0.15 +- 0.12 rad, where nothing else is named."""
    play = "drive.backlash"
    monkeypatch.setattr(
        validation, "fitted_parameters", lambda *_: {"angle": ParameterResult(0.15, 0.12, "rad", 0.0)}
    )
    monkeypatch.setattr(FitUncertainty, "of", lambda _: None)
    causes = {play: SimpleNamespace(name=play, effect=effect(play))}
    fit = SimpleNamespace(point=SimpleNamespace(active={play: 1.5}))
    search: Any = SimpleNamespace(fit=fit, problem=SimpleNamespace(causes=causes), leads={play: gain})
    assert (not validation._causes_without_size(search)) == stands
