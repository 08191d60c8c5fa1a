"""Causes hidden by an independent plant must be found; seeds are fixed, the benchmark draws fresh ones."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import Hidden, draw, draw_unknown
from first_problem import make_problem
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.experiment.manoeuvres import manoeuvre
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.result import Verdict
from raccoon.diagnose.select.probe_scores import find_best_probe
from raccoon.diagnose.select.refits import SHARED_SCALE_CAUSES
from raccoon.diagnose.select.replacements import replace_by_better_sets
from raccoon.diagnose.select.search import PROBE_GATE, _restart_beside_probe, select_forward
from raccoon.diagnose.select.state import linearise_search, refit_with_final_noise, start_search
from raccoon.diagnose.unknown.probes import make_probe_function
from raccoon.diagnose.unknown.shapes import fit_shapes
from simulated_drives import BLIND_CONTROLLER


def test_a_single_hidden_cause_is_named_first() -> None:
    """With a number near the hidden one. What it gains is judged on 14 s of the drive that follow: of 7 s one
    late wheel is a large part."""
    hidden = draw("actuation.latency", np.random.default_rng(5))
    whole = make(5, [hidden], seconds=24.0).columns
    seen = whole["t"] < 10.0
    first, later = ({key: values[part] for key, values in whole.items()} for part in (seen, ~seen))
    said = diagnose(first, RobotConfig(), holdout=later, firmware=BLIND_CONTROLLER)
    assert said.causes, said.rejected
    assert said.causes[0].name == hidden.name
    assert said.causes[0].gain.heldout_rmse_after < said.causes[0].gain.heldout_rmse_before
    found = said.causes[0].parameters["seconds"]
    assert found.value == pytest.approx(hidden.values["seconds"], rel=0.05)
    assert said.verdict is Verdict.EXPLAINED
    assert said.causes[0].change > said.causes[0].unabsorbed > 1.0
    assert not any("is it the same robot" in note for note in said.notes)


def test_play_is_named_though_a_drive_seldom_reverses() -> None:
    """12 s as a team's program drives: the columns of no play lead nowhere near it, and what it does where
    speeds change was called noise, or unknown."""
    hidden = draw("drive.backlash", np.random.default_rng(2))
    columns = make(2, [hidden], drive="contest", seconds=12.0).columns
    said = diagnose(columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    assert [each.name for each in said.causes] == ["drive.backlash"]
    assert said.causes[0].parameters["angle"].value == pytest.approx(hidden.values["angle"], rel=0.1)
    assert not said.unexplained.depends_on


def causes_of(*ids: str) -> list[Cause]:
    """Those with such beginnings of their ids, for what does not depend on what else is looked for."""
    return [each for each in drive_causes() if each.id.startswith(ids)]


def test_three_hidden_causes_are_all_named_and_nothing_else() -> None:
    """Two of them bend what a curve of the gyro over speed frees."""
    rng = np.random.default_rng(6)
    hidden = [draw(each, rng) for each in ("bemf.offset", "imu.gyro_drift", "battery.discharge")]
    said = diagnose(make(6, hidden, seconds=8.0).columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    assert {each.name for each in said.causes} == {each.name for each in hidden}
    assert not said.unexplained.depends_on


def test_a_wrong_set_is_exchanged_for_the_right_one() -> None:
    """Steps that add one cause at a time can end there: each of two wrong ones explains much."""
    rng = np.random.default_rng(12)
    hidden = [draw(each, rng) for each in ("actuation.latency", "motor.armature_resistance")]
    log = log_from_columns(make(12, hidden, seconds=8.0).columns, RobotConfig())
    problem = make_problem(log, RobotConfig(), causes_of("actuation.", "motor.", "bemf.", "drive.inertia"))
    start = start_search(problem, make_probe_function(problem))
    wrong = start.fit.point.with_cause("bemf.filter_lag", np.array([0.5]))
    wrong = wrong.with_cause("drive.inertia", np.array([0.3]))
    fit = fit_point(problem, start.whitener, wrong)
    astray = linearise_search(problem, start.probes, fit.point, start.whitener)
    better, exchanged = replace_by_better_sets(astray)
    assert exchanged
    assert set(better.fit.point.active) <= {each.name for each in hidden}
    assert set(select_forward(better).fit.point.active) == {each.name for each in hidden}


def test_an_effect_at_a_third_of_its_size_is_never_taken_for_another() -> None:
    hidden = draw("imu.latency", np.random.default_rng(8), size=0.3)
    said = diagnose(make(8, [hidden], seconds=12.0).columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    assert [each.name for each in said.causes] == [hidden.name]


def test_a_cause_of_a_few_large_moments_is_not_called_unknown() -> None:
    """What reversals leave of it bends base numbers, so that everything between them is off as well."""
    hidden = draw("motor.current_limit", np.random.default_rng(1))
    columns = make(1, [hidden], drive=manoeuvre("spin")[:800]).columns
    said = diagnose(columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    assert [each.name for each in said.causes] == [hidden.name]
    assert not said.unexplained.depends_on


def test_what_is_real_but_changes_next_to_nothing_is_said_not_to_matter() -> None:
    """A reading of 2 counts is read as 0: many zeros give that a name, but none of them is off by much."""
    hidden = Hidden("bemf.dead_zone", None, {"counts": 2.0}, {"dead_zone": 2.0})
    columns = make(8, [hidden], seconds=20.0).columns  # of seed 6 it is at the gate
    said = diagnose(columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    assert [each.name for each in said.causes] == [hidden.name]
    assert said.causes[0].is_negligible
    assert said.verdict is Verdict.ADEQUATE


@pytest.mark.parametrize(
    ("seed", "seconds"),
    [(3, 18.0), (50, 6.0)],
)
def test_a_clean_recording_is_adequate_short_or_long(seed: int, seconds: float) -> None:
    said = diagnose(make(seed, seconds=seconds).columns, RobotConfig())
    assert said.verdict is Verdict.ADEQUATE
    assert said.causes == ()


def test_a_robot_of_another_friction_has_nothing_wrong_for_that() -> None:
    """Its wheels give next to nothing before they slide."""
    hidden = draw("drive.inertia", np.random.default_rng(6))
    rigid = Hidden("unknown", None, {}, {"bristle": 30000.0, "bristle_damping": 12.0})
    said = diagnose(make(6, [rigid, hidden], seconds=9.0).columns, RobotConfig())
    assert [each.name for each in said.causes] == [hidden.name]
    assert said.verdict is Verdict.EXPLAINED


def test_a_robot_whose_gyro_smooths_has_nothing_wrong_for_that() -> None:
    chip = Hidden("unknown", None, {}, {"gyro_smooth": 0.0039})
    said = diagnose(make(8, [chip], seconds=9.0).columns, RobotConfig())
    assert said.causes == ()
    assert any("41 Hz" in each for each in said.notes)
    slip = next(each.reason for each in said.rejected if each.id == "drive.wheel_slip")
    assert "imu.low_pass" in slip


def test_motors_that_are_read_by_encoders_need_not_coast() -> None:
    hidden = draw("drive.turn_scrub", np.random.default_rng(8))
    columns = make(8, [hidden], seconds=8.0, encoders=True).columns
    said = diagnose(columns, RobotConfig(), causes=causes_of("motor.", "drive.", "actuation."))
    assert [each.name for each in said.causes] == [hidden.name]
    assert not any("pause" in each or "standard deviations off" in each for each in said.notes)


def test_structural_twins_are_reported_as_a_class() -> None:
    hidden = draw("imu.gyro_scale", np.random.default_rng(5))
    said = diagnose(make(5, [hidden], seconds=7.0).columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    first, twins = said.causes[0], {"imu.gyro_scale", "drive.track_width", "drive.wheel_radius"}
    assert {first.id, *first.confounded_with} >= twins
    reasons = {each.id: each.reason for each in said.rejected}
    for other in twins - {first.id}:
        assert reasons[other] == f"looks much like {first.name} and may be the true cause instead"
    assert any("full turns" in each for each in said.suggested_manoeuvres)


def test_what_a_creeping_drive_does_not_tell_from_a_slope_is_said_with_it() -> None:
    """Each of the two explains more under the noise that is left of the other."""
    values = {"asymmetry": -0.08080025382621404, "viscous_asymmetry": 0.0}
    plant = {"dir_coulomb": values["asymmetry"], "dir_viscous": 0.0}
    hidden = Hidden("friction.direction_dependent", None, values, plant)
    columns = make(198337167, [hidden], drive=manoeuvre("creep")).columns
    asked = causes_of("friction.", "drive.slope", "imu.gyro")
    said = diagnose(columns, RobotConfig(), causes=asked, firmware=BLIND_CONTROLLER)
    (cause,) = said.causes
    assert {cause.name, *cause.confounded_with} == {hidden.name, "drive.slope"}
    assert cause.probability < 0.7


def test_what_was_nearly_as_likely_when_a_cause_was_named_is_said_with_it() -> None:
    """Circles at a few speeds hardly distinguish viscous friction from a drag by the square of the speed,
    which was named with a probability of 1, since no column shows that one may take the other's place."""
    hidden = Hidden("friction.viscous", None, {"coefficient": 0.01346}, {"viscous": 0.01346})
    columns = make(844059712, [hidden], drive=manoeuvre("circles")).columns
    (cause,) = diagnose(columns, RobotConfig()).causes
    assert {cause.name, *cause.confounded_with} >= {hidden.name, "friction.quadratic"}
    assert cause.probability < 0.8


def test_what_no_drive_tells_apart_is_for_the_bench() -> None:
    """Power steps were advised, after power steps as well."""
    hidden = Hidden(
        "motor.armature_resistance", None, {"factor": 1.4}, {"resistance_l": 2.52, "resistance_r": 2.52}
    )
    said = diagnose(make(6, [hidden], seconds=6.0).columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    (cause,) = said.causes
    assert cause.id in SHARED_SCALE_CAUSES
    assert {cause.id, *cause.confounded_with} == set(SHARED_SCALE_CAUSES)
    assert "ohmmeter" in said.suggested_manoeuvres[0]
    assert not any(each.startswith("random power steps") for each in said.suggested_manoeuvres)


def test_a_cause_of_no_catalogue_is_called_unknown_with_what_it_depends_on() -> None:
    hidden = draw_unknown("gyro_side", np.random.default_rng(1))
    said = diagnose(make(1, [hidden], seconds=8.0).columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    assert said.verdict is Verdict.UNKNOWN
    assert said.unexplained.depends_on == ("gyro over turn rate",)
    (shape,) = said.shapes
    assert said.to_dict()["shapes"][0]["over"] == shape.over.tolist()


@pytest.mark.parametrize(
    ("kind", "covariate", "seconds"),
    [("gyro_speed", "gyro over speed", 12.0), ("payload", "time (inertia)", 24.0)],
)
def test_what_no_catalogue_has_is_shown_in_its_course(kind: str, covariate: str, seconds: float) -> None:
    hidden = draw_unknown(kind, np.random.default_rng(1))
    log = log_from_columns(make(1, [hidden], seconds=seconds).columns, RobotConfig())
    problem = make_problem(log, RobotConfig(), drive_causes())
    start = start_search(problem, make_probe_function(problem))
    probe = find_best_probe(start)
    assert probe.name == f"unknown: {covariate}"
    assert probe.lead > PROBE_GATE
    (shape,) = fit_shapes(refit_with_final_noise(_restart_beside_probe(start, probe)))
    assert shape.depends_on == covariate
    if kind == "payload":  # falls on the robot 15 s after the start
        early, late = shape.over < 14.0, shape.over > 16.0
        assert np.abs(shape.values[early]).max() < 5.0
        load = np.full(late.sum(), 100.0 * hidden.values[kind])
        assert shape.values[late] == pytest.approx(load, rel=0.1)
    else:
        forward = 0.0345 * np.abs(shape.over)
        slope, _ = np.polyfit(forward, shape.values, 1)
        assert slope == pytest.approx(hidden.values[kind], rel=0.2)
