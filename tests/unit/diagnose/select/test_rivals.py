"""What else would explain a recording in the place of a cause."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from raccoon.diagnose.findings.cause_results import (
    TURN_CLASSES,
    _describe,
    cause_probability,
    confounded_causes,
    fitted_parameters,
    largest_deviation,
    make_cause_results,
)
from raccoon.diagnose.findings.held_out import HeldOut, contributions
from raccoon.diagnose.findings.joint_numbers import describe_known_product
from raccoon.diagnose.findings.suggestions import _separating_command
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_point, fit_starts, fit_with_frozen_columns
from raccoon.diagnose.fit.linear_model import coulomb_response, linearise
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.slip_forms import try_immediate_slip
from raccoon.diagnose.habits.trials import HabitTrials
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.result import ParameterResult
from raccoon.diagnose.rollout.firmware import FIRMWARES
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select import rivals
from raccoon.diagnose.select.gates import EVIDENCE_GATE
from raccoon.diagnose.select.rivals import (
    MAX_CLASS_LEAD,
    MAX_DEFICIT_TO_REFINE,
    MAX_DEFICIT_TO_RESTART,
    compare_rivals,
    find_similar_causes,
    mark_as_likely,
    rivals_only_beside,
)
from raccoon.diagnose.select.state import Rival, Search
from raccoon.diagnose.unknown.probes import make_probe_function
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import effect
from unit.diagnose.searches import searched

CAUSES = {
    each.name: each
    for each in drive_causes()
    if each.id in ("imu.latency", "drive.wheel_slip", "drive.inertia", "imu.gyro_bias", "friction.coulomb")
}


@pytest.fixture(scope="module")
def causes() -> dict[str, Cause]:
    return CAUSES


def test_a_small_lag_has_a_rival_and_a_large_one_has_none(problem: Problem) -> None:
    for widths, one in ((0.05, True), (1.0, False)):
        late = problem.nominal().with_cause("imu.latency", np.array([widths]))
        search = searched(problem, late, late)
        assert compare_rivals(search) is None
        tried = [each for each in search.rivals["imu.latency"] if each.name == "drive.wheel_slip"]
        (slip,) = (each for each in tried if not each.beside)
        assert (slip.lead < MAX_CLASS_LEAD) == one
        assert ("drive.wheel_slip" in confounded_causes(search, CAUSES["imu.latency"])) == one


def test_what_a_gyro_s_chip_may_do_is_ranked_by_how_likely_it_does_not(problem: Problem) -> None:
    truth = problem.nominal().with_cause("drive.wheel_slip", np.array([0.3]))
    truth = truth.with_cause("imu.gyro_bias", np.array([1.2]))
    search = searched(problem, truth, truth)
    sizes = {name: each.unabsorbed for name, each in contributions(search).items()}
    assert 0.27 * sizes["drive.wheel_slip"] < sizes["imu.gyro_bias"] < 0.73 * sizes["drive.wheel_slip"]
    judged = cast("HeldOut", SimpleNamespace(without=sizes, size_after=1.0, share=lambda _: 0.0))
    for lacks, first in ((5.0, "drive.wheel_slip"), (-5.0, "imu.gyro_bias")):
        search.rivals["drive.wheel_slip"] = [Rival("imu.low_pass", lacks)]
        ranked = make_cause_results(search, judged, FitUncertainty.of(search))
        assert (ranked[0].name, ranked[0].rank) == (first, 1)


def test_what_is_most_alike_is_tried_however_little_alike_it_is(problem: Problem) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([1.0]))
    search = searched(problem, late, late)
    every = list(find_similar_causes(search, "imu.latency", 0.0, 9))
    assert len(every) > 2
    assert list(find_similar_causes(search, "imu.latency", 1.0, 9, 2)) == every[:2]
    assert list(find_similar_causes(search, "imu.latency", 1.0, 9)) == []


@pytest.mark.parametrize(("behind", "tried"), [(MAX_DEFICIT_TO_REFINE, True), (16.0, False)])
def test_what_was_nearly_as_likely_before_is_tried_from_where_it_was(
    problem: Problem, behind: float, tried: bool
) -> None:
    biased = problem.nominal().with_cause("imu.gyro_bias", np.array([1.2]))
    late = biased.with_cause("imu.latency", np.array([0.5]))
    search = searched(problem, late, late)
    then = Point(biased.base + 0.1, {**biased.active, "friction.coulomb": np.array([0.3])})
    search.rivals = {"imu.latency": [Rival("friction.coulomb", behind, point=then)]}
    found = {rival: start for name, rival, start in rivals._rival_starts(search) if name == "imu.latency"}
    assert ("friction.coulomb" in found) == tried
    if tried:
        start = found["friction.coulomb"]
        assert start.active == then.active
        assert np.array_equal(start.base, then.base)
        beside = replace(search, fit=replace(search.fit, point=late.without_cause("imu.gyro_bias")))
        alone = rivals._known_rivals(beside, "imu.latency")["friction.coulomb"]
        assert [*alone.active] == ["friction.coulomb"]  # the other cause is gone, and its base numbers
        assert np.array_equal(alone.base, late.base)


def test_of_two_that_outdo_each_other_neither_outdoes_the_other() -> None:
    its = {"a": [Rival("b", -5.1), Rival("c", -2.0), Rival("d", 9.0)]}
    search = cast("Search", SimpleNamespace(rivals=its))
    mark_as_likely(search, frozenset({"b"}))
    assert search.rivals["a"] == [Rival("c", -2.0), Rival("b", 0.0), Rival("d", 9.0)]


def test_a_rival_whose_fit_stands_still_is_fitted_from_elsewhere(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([0.2]))
    search = searched(problem, late, late)

    def lacks() -> float:
        assert compare_rivals(search) is None
        tried = [each for each in search.rivals["imu.latency"] if each.name == "drive.wheel_slip"]
        return next(each.lead for each in tried if not each.beside)

    there = lacks()
    assert MAX_CLASS_LEAD < there < MAX_DEFICIT_TO_RESTART - 8.0

    def behind(fits: list[Fit]) -> list[Fit]:
        return [replace(each, cost=each.cost + 2.0 * 6.0) for each in fits]

    monkeypatch.setattr(
        rivals, "fit_with_frozen_columns", lambda *words: behind(fit_with_frozen_columns(*words))
    )
    monkeypatch.setattr(rivals, "fit_starts", lambda *words: behind(fit_starts(*words)))
    assert lacks() == pytest.approx(there, abs=0.5)


def test_of_two_lags_that_are_not_told_apart_the_sum_is_said(problem: Problem) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([0.04]))
    truth = late.with_cause("drive.wheel_slip", np.array([0.04]))
    search = searched(problem, truth, late)
    search = replace(search, fit=fit_point(search.problem, search.whitener, late))
    assert compare_rivals(search) is None
    cause, settings = CAUSES["imu.latency"], problem.settings(truth)
    rivals = confounded_causes(search, cause)
    assert rivals == ("drive.wheel_slip",)
    values = fitted_parameters(search, cause, FitUncertainty.of(search))
    whole = settings[("imu.latency", None, "seconds")] + settings[("drive.wheel_slip", "left", "time")]
    assert values["seconds"].value == pytest.approx(whole, abs=2.0 * values["seconds"].std)
    assert values["seconds"].std < 0.25 * whole
    assert "With drive.wheel_slip beside it this is the sum of their times." in _describe(
        problem, cause, values, rivals
    )
    assert "sum" not in _describe(problem, cause, values, ())


@pytest.mark.parametrize(("more", "beside"), [(3.9, True), (4.1, False)])
def test_a_quarter_of_a_lag_may_be_anothers_where_it_costs_two_deviations(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, more: float, beside: bool
) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    search = searched(problem, late, late)
    search.rivals = {"imu.latency": []}
    monkeypatch.setattr(rivals, "cost_with_last_held", lambda *_: search.fit.cost + more)
    found = [(name, other, lacks) for name, other, _, lacks in rivals._split_lag_deficits(search, search.fit)]
    assert [each[:2] for each in found] == [("imu.latency", "drive.wheel_slip")] * beside
    assert [lacks for *_, lacks in found] == pytest.approx([0.5 * more] * beside)


def test_a_lag_that_may_be_two_is_said_with_the_other_and_no_less_sure(problem: Problem) -> None:
    """Neither stands in for the other, and yet how much each is of the sum is not known. (From 0.02 widths of
    slip on it is, since the simulated gyro looks exactly as late as it says.)"""
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    truth = late.with_cause("drive.wheel_slip", np.array([0.01]))
    search = searched(problem, truth, late)
    search = replace(search, fit=fit_point(search.problem, search.whitener, late))
    compare_rivals(search)
    tried = {each.beside: each for each in search.rivals["imu.latency"] if each.name == "drive.wheel_slip"}
    assert tried[False].lead > MAX_CLASS_LEAD
    assert confounded_causes(search, CAUSES["imu.latency"]) == ("drive.wheel_slip",)
    assert cause_probability(search, "imu.latency", ("drive.wheel_slip",), {}) > 0.999
    assert rivals_only_beside(search, "imu.latency", ("drive.wheel_slip",)) == ("drive.wheel_slip",)
    instead = Rival("drive.wheel_slip", MAX_CLASS_LEAD - 0.1)
    search.rivals["imu.latency"].append(instead)
    assert rivals_only_beside(search, "imu.latency", ("drive.wheel_slip",)) == ()


@pytest.mark.parametrize(
    ("named", "behind", "lacking"),
    [(3, 5.0, 5.0), (4, 9.0, 9.0 - EVIDENCE_GATE + math.log(17 / 5)), (4, 2.0, 0.0), (4, -3.0, -3.0)],
)
def test_among_many_a_twins_further_cause_lacks_its_rarity_instead_of_its_gate(
    monkeypatch: pytest.MonkeyPatch, named: int, behind: float, lacking: float
) -> None:
    """Of 20 that are asked for; no lead comes of what is spared, and one that leads keeps its lead."""
    now = [f"a.{each}" for each in range(named)]

    def standing(active: list[str]) -> Any:
        return SimpleNamespace(point=SimpleNamespace(active=dict.fromkeys(active)))

    twin = standing([*now[1:], "b.0", "b.1"])
    monkeypatch.setattr(rivals, "fit_twins", lambda _: [(now[0], twin)])
    monkeypatch.setattr(rivals, "net_lead", lambda *_: -behind)
    causes = {f"a.{each}": SimpleNamespace(id=f"a.{each}") for each in range(20)}
    problem = SimpleNamespace(causes=causes, settings=lambda _: {})
    search = SimpleNamespace(problem=problem, fit=standing(now), rivals={name: [] for name in now})
    assert rivals._compare_twins(cast(Search, search), twin) == [twin]
    found = {each.name: each for each in search.rivals[now[0]]}
    assert {name: each.together for name, each in found.items()} == {"b.0": ("b.1",), "b.1": ("b.0",)}
    assert [each.lead for each in found.values()] == pytest.approx([lacking] * 2)


@pytest.mark.parametrize(("std", "away"), [(0.0005, 4.0), (0.002, 1.0), (0.02, 0.1)])
def test_a_cause_is_no_surer_than_its_number_is_away_from_what_was_assumed(
    std: float, away: float, problem: Problem
) -> None:
    """However much it explains; but for what may be another in its place."""
    search = searched(problem, problem.nominal(), problem.nominal())
    search.leads["drive.wheel_slip@right"] = 19.0
    values = {"time": ParameterResult(0.002, std, "s", 0.0)}
    said = cause_probability(search, "drive.wheel_slip@right", (), values)
    assert said == pytest.approx(1.0 / (1.0 + math.exp(-0.5 * away**2)))
    rival = ("imu.latency",)
    assert cause_probability(search, "drive.wheel_slip@right", rival, values) == pytest.approx(0.5)


def test_what_says_of_which_kind_a_cause_is_does_not_make_it_surer() -> None:
    values = {
        "angle": ParameterResult(0.01, 0.01, "rad", 0.0),
        "coasting": ParameterResult(0.01, 1e-5, "s", 0.0),
    }
    assert largest_deviation(effect("drive.backlash"), values) == pytest.approx(1.0)
    assert largest_deviation(
        effect("friction.coulomb"), {"torque": ParameterResult(0.2, 0.01, "N m", 0.18)}
    ) == (pytest.approx(2.0))
    assert largest_deviation(effect("drive.backlash"), {}) == math.inf


@pytest.mark.parametrize(("cause", "widths"), [("actuation.latency", 0.1), ("bemf.filter_lag", -0.3)])
def test_a_lag_that_is_told_from_the_filter_is_not_said_to_be_in_part_it(
    problem: Problem, cause: str, widths: float
) -> None:
    """What robot.toml leaves open of the filter took back what the latency gave away, so that any latency was
    said to be the sum; and a filter that is quicker than assumed is no latency in part."""
    both = {each.name: each for each in drive_causes() if each.id in ("actuation.latency", "bemf.filter_lag")}
    lagging = replace(problem, causes=both)
    late = problem.nominal().with_cause(cause, np.array([widths]))
    search = searched(lagging, late, late)
    search = replace(search, fit=fit_point(search.problem, search.whitener, late))
    assert compare_rivals(search) is None
    assert confounded_causes(search, both[cause]) == ()
    values = fitted_parameters(search, both[cause], FitUncertainty.of(search))
    other = next(iter(set(both) - {cause}))
    said = _describe(lagging, both[cause], values, (other,))
    assert ("sum" in said) is (other == "actuation.latency")  # of the filter base numbers know a part already


def test_a_lag_that_is_two_is_found_to_be_two(problem: Problem) -> None:
    """From the sum in one of them no step by single causes need lead to both."""
    lags = {each.name: each for each in drive_causes() if each.name in ("imu.latency", "drive.wheel_slip")}
    lagging = replace(problem, causes=lags)
    one = problem.nominal().with_cause("imu.latency", np.array([0.5]))
    both = one.with_cause("drive.wheel_slip", np.array([0.4]))
    for truth, found in ((both, set(lags)), (one, None)):
        search = searched(lagging, truth, one)
        search = replace(search, fit=fit_point(search.problem, search.whitener, one))
        better = compare_rivals(search)
        assert (better and set(better.point.active)) == found


def asking_for_twins(search: Search) -> Search:
    asked = {each.name: each for each in drive_causes() if each.name in TURN_CLASSES[0]}
    return replace(search, problem=replace(search.problem, causes={**search.problem.causes, **asked}))


def test_what_only_an_unrecorded_reading_shows_is_no_rival() -> None:
    """With encoders an offset of back-EMF changes nothing, and was in the class of a resistance."""
    asked = {each.name: each for each in drive_causes()}
    close = [Rival(name, 1.0) for name in ("bemf.offset", "bemf.offset@left", "bemf.offset@right")]
    for roles, found in (((), []), (("bemf_left",), close[:2]), (("bemf_left", "bemf_right"), close)):
        search = SimpleNamespace(
            rivals={"friction.coulomb": close},
            fit=SimpleNamespace(point=SimpleNamespace(active={})),
            problem=SimpleNamespace(causes=asked, features=SimpleNamespace(roles=roles)),
        )
        said = confounded_causes(cast(Search, search), asked["friction.coulomb"])
        assert said == tuple(each.name for each in found)


def test_a_rival_brings_no_twin_that_a_reference_has_decided(problem: Problem) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([0.3]))
    search = searched(problem, late, late)
    search.rivals = {"imu.latency": [Rival("drive.wheel_slip", MAX_CLASS_LEAD - 1.0)]}
    assert confounded_causes(search, CAUSES["imu.latency"]) == ("drive.wheel_slip",)
    radius = next(each for each in drive_causes() if each.name == "drive.wheel_radius")
    assert confounded_causes(search, radius) == ()
    assert set(confounded_causes(asking_for_twins(search), radius)) == {"imu.gyro_scale", "drive.track_width"}


def test_of_two_twins_only_what_they_do_together_is_said(problem: Problem) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([0.3]))
    search = asking_for_twins(searched(problem, late, late))
    causes = search.problem.causes
    one = Point(late.base, {"drive.track_width": np.array([1.0])})
    both = Point(late.base, {**one.active, "imu.gyro_scale": np.array([-1.0])})

    def said(point: Point) -> str:
        settings = search.problem.settings(point)
        spread = FitUncertainty(settings, (), np.zeros((0, 0)))
        search.fit = replace(search.fit, point=point)
        return describe_known_product(search, causes["drive.track_width"], spread)

    assert said(one) == ""
    settings = search.problem.settings(both)
    wide = settings[("drive.track_width", None, "factor")]
    reads = settings[("imu.gyro_scale", None, "factor")] / wide
    assert said(both).startswith(" Together with imu.gyro_scale, only their combined effect is known")
    assert f"the gyro reads {reads:.3f} times" in said(both)


def test_one_wheels_slip_is_not_counted_again_as_both_wheels(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The form of slip is asked for where it would stand beside no other slip."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    asked: list[list[Point]] = []

    def never(search: Search, problem: Problem, starts: list[Point]) -> float:
        asked.append(starts)
        return 0.0

    monkeypatch.setattr("raccoon.diagnose.habits.slip_forms.log_evidence_lead", never)
    both = late.with_cause("drive.wheel_slip@left", np.array([0.4]))
    for point, count in ((late, 2), (both, 2)):
        search, habits = searched(problem, point, point), Habits(Chain.firmware(), False)
        assert try_immediate_slip(search, habits, HabitTrials(lambda _: problem)) == (search, habits)
        assert len(asked) == count
    for (start,) in asked:  # all of the lag, and that less what a gyro's chip may be
        assert list(start.active) == ["drive.wheel_slip"]


def test_a_rival_brings_its_twins_but_those_that_are_named(problem: Problem) -> None:
    """K_E was said with the track width beside it where the gyro's scale, that one's twin, was hidden."""
    late = problem.nominal().with_cause("imu.latency", np.array([0.3]))
    search = asking_for_twins(searched(problem, late, late))
    search.rivals = {"imu.latency": [Rival("drive.track_width", MAX_CLASS_LEAD - 1.0)]}
    cause = CAUSES["imu.latency"]
    assert set(confounded_causes(search, cause)) == {
        "drive.track_width",
        "drive.wheel_radius",
        "imu.gyro_scale",
    }
    both = Point(late.base, {**late.active, "imu.gyro_scale": np.zeros(1)})
    search.fit = replace(search.fit, point=both)
    assert set(confounded_causes(search, cause)) == {"drive.track_width", "drive.wheel_radius"}
    search.rivals = {"imu.latency": [Rival("drive.track_width", MAX_CLASS_LEAD + 1.0)]}
    assert confounded_causes(search, cause) == ()


def test_a_rival_that_explains_more_takes_the_place(problem: Problem) -> None:
    nominal = problem.nominal()
    late = nominal.with_cause("imu.latency", np.array([1.0]))
    better = compare_rivals(searched(problem, late, nominal.with_cause("drive.wheel_slip", np.array([1.0]))))
    assert better is not None
    assert list(better.point.active) == ["imu.latency"]
    assert better.point.active["imu.latency"] == pytest.approx([1.0], abs=0.05)


def test_a_cause_of_one_wheel_is_compared_with_that_of_both(problem: Problem) -> None:
    nominal = problem.nominal()
    both = nominal.with_cause("drive.wheel_slip", np.array([1.0]))
    one = nominal.with_cause("drive.wheel_slip@left", np.array([1.0]))
    better = compare_rivals(searched(problem, both, one))
    assert better is not None
    assert list(better.point.active) == ["drive.wheel_slip"]


def test_the_report_says_what_to_drive_to_tell_a_cause_from_its_rival(problem: Problem) -> None:
    late = problem.nominal().with_cause("imu.latency", np.array([0.05]))
    search = searched(problem, late, late)
    search.rivals = {
        "imu.latency": [Rival("drive.wheel_slip", 2.0)],
        "imu.gyro_scale": [Rival("drive.track_width", 0.0)],
    }
    said = _separating_command(search, "imu.latency", ("drive.wheel_slip",))
    assert said is not None
    assert said.startswith("raccoon excite --cause imu.latency --rival drive.wheel_slip --record ")
    assert _separating_command(search, "imu.latency", ()) is None
    assert _separating_command(search, "imu.gyro_scale", ("drive.track_width",)) is None  # no drive does


def test_what_a_named_cause_changes_can_still_be_seen_to_vary(problem: Problem) -> None:
    """A load that falls on the robot is more inertia from then on, whether or not inertia has been named."""
    nominal = problem.nominal()
    off = linearise(problem, nominal, list(CAUSES))
    on = linearise(problem, nominal.with_cause("drive.inertia", np.zeros(1)), list(CAUSES))
    one, other = (np.asarray(each.column("drive.inertia")).ravel() for each in (off, on))
    assert one @ other > 0.98 * np.linalg.norm(one) * np.linalg.norm(other)
    assert f"{UNKNOWN_PREFIX}time (inertia)" in {each.name for each in make_probe_function(problem)(on)}
    assert on.column("imu.nothing") is None


def test_friction_that_wanders_can_still_be_seen_where_friction_was_named(problem: Problem) -> None:
    off = linearise(problem, problem.nominal(), list(CAUSES))
    point = problem.nominal().with_cause("friction.coulomb@left", np.array([0.1]))
    responses = [coulomb_response(problem, each, "left") for each in (off, linearise(problem, point, []))]
    one, other = (np.asarray(each).ravel() for each in responses)
    assert one @ other > 0.98 * np.linalg.norm(one) * np.linalg.norm(other)
    assert np.linalg.norm(one) == pytest.approx(np.linalg.norm(other), rel=0.1)


@pytest.mark.parametrize(
    ("low_pass", "firmware", "asks"),
    [(False, None, "same less"), (True, None, "same more"), (True, "wombat-stock", "same")],
)
def test_an_immediate_slip_is_also_asked_for_without_the_low_pass_that_took_a_part_of_it(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, low_pass: bool, firmware: str | None, asks: str
) -> None:
    """Of 14.5 ms, with a gyro without a chip, 11.1 +- 0.5 ms were left beside a chip's filter of 2.4 ms."""
    asked: list[tuple[bool, float]] = []
    known = None if firmware is None else FIRMWARES[firmware]
    habits = Habits(Chain.firmware(), False, low_pass=low_pass, firmware=known)
    tried: list[Habits] = []

    def problem_of(other: Habits) -> Problem:
        tried.append(other)
        return problem

    def never(search: Search, problem: Problem, starts: list[Point]) -> float:
        asked.append((tried[-1].low_pass, float(starts[0].active["drive.wheel_slip"][0])))
        return 0.0

    monkeypatch.setattr("raccoon.diagnose.habits.slip_forms.log_evidence_lead", never)
    late = problem.nominal().with_cause("imu.latency", np.array([0.4]))
    try_immediate_slip(searched(problem, late, late), habits, HabitTrials(problem_of))
    chip, size = low_pass, asked[0][1]
    assert asked[0][0] is chip
    assert ["same", *(("more" if each > size else "less") for _, each in asked[1:])] == asks.split()
    assert all(each is not chip for each, _ in asked[1:])
