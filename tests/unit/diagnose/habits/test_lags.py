"""Lags that were named or taken for habits: where a gyro's chip makes a part of them, or none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import Hidden, draw
from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.habits.chains import FREE_RUNNING
from raccoon.diagnose.habits.lags import (
    GYRO_LATENCY,
    SLIP,
    note_rival,
    starts_with_low_pass,
    try_lagging_readings,
    try_lags_as_causes,
    try_low_pass_for_gyro_lag,
)
from raccoon.diagnose.habits.trials import HabitTrials
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.state import Rival, Search
from raccoon.sim.effects.chain import Chain
from unit.diagnose.searches import standing

FIRMWARE = Habits(Chain.firmware(), False)
CHIP = {"gyro_smooth": 0.0039}
STRENGTH = "motor.back_emf_constant"
OTHERS = ("friction.viscous", "battery.internal_resistance")
AMONG = (STRENGTH, *OTHERS, "actuation.latency", SLIP, GYRO_LATENCY)
"""All that is hidden here, and all lags but the filter's."""


def gone_on(
    seed: int, others: dict[str, float], named: dict[str, float], *hidden: Hidden
) -> tuple[Search, Habits]:
    """What becomes of a search of 6 s of a blind robot, with other numbers of its plant, whose right motor
    is a stronger or weaker one."""
    motor = draw(STRENGTH, np.random.default_rng(seed))
    columns = make(seed, [Hidden("unknown", None, {}, others), *hidden, motor], seconds=6.0).columns
    named = {motor.name: np.sign(motor.values["factor"] - 1.0), **named}
    search, trials = standing(columns, FIRMWARE, named, AMONG)
    assert search.fit.point.active.keys() == named.keys()
    return try_lagging_readings(search, FIRMWARE, trials)


def test_beside_one_other_cause_a_gyro_that_smooths_is_no_late_one() -> None:
    search, habits = gone_on(8, CHIP, {GYRO_LATENCY: 0.1})
    assert set(search.fit.point.active) == {f"{STRENGTH}@right"}
    assert habits.low_pass


def test_a_slip_a_little_larger_than_a_chip_s_lag_is_left_out_beside_a_late_gyro(problem: Problem) -> None:
    """Of 11.3 ms and a chip, 4.5 ms of slip were named: the chip paid a gate for 0.6 ms that were left."""
    slip, late = (problem.causes[each].coordinates[0] for each in (SLIP, GYRO_LATENCY))
    point = problem.nominal().with_cause(SLIP, np.array([0.0045 / slip.value(1.0)]))
    point = point.with_cause(GYRO_LATENCY, np.array([0.0113 / late.value(1.0)]))
    search = cast(Search, SimpleNamespace(fit=SimpleNamespace(point=point), problem=problem))
    names = [GYRO_LATENCY, SLIP]
    starts = starts_with_low_pass(search, names, names)
    assert {GYRO_LATENCY} in [set(each.active) for each in starts]


SLIPS = Hidden(SLIP, None, {"time": 0.005}, {"slip": 0.005})


def smoothed(first: Hidden, chain: Chain, others: tuple[str, ...]) -> tuple[Search, Habits, HabitTrials]:
    """A robot of which `first` lags beside a stronger or weaker motor and others of its faults, where these
    were named and the lag was taken for a gyro that smooths under this chain, as it is while nothing else has
    been found."""
    motor, *more = hidden = [draw(each, np.random.default_rng(8)) for each in (STRENGTH, *others)]
    columns = make(8, [first, *hidden], seconds=10.0).columns
    habits = Habits(chain, brake=False, low_pass=True)
    named = {motor.name: np.sign(motor.values["factor"] - 1.0), **{each.name: 1.0 for each in more}}
    search, trials = standing(columns, habits, named, AMONG)
    return search, habits, trials


def test_a_slip_that_was_taken_for_other_readings_is_named_once_much_else_is_wrong() -> None:
    """Of 17 slips beside many causes 12 were left to a chip, which was taken while little else was known."""
    search, habits, trials = smoothed(SLIPS, FREE_RUNNING, OTHERS)
    usual = replace(habits, chain=Chain.firmware(), low_pass=False)
    trials.reject(search, habits, [usual])  # as a search for the filter notes that is not told of lags
    found, now = try_lags_as_causes(search, habits, trials)
    assert not now.low_pass
    assert not now.chain.free_running
    assert trials.lags_of_robot == {habits}
    assert found.fit.point.active.keys() == {SLIP, *search.fit.point.active}
    fit = fit_point(found.problem, found.whitener, found.fit.point)  # under the noise that is known by now
    size = fit.point.active[SLIP][0] * found.problem.causes[SLIP].coordinates[0].value(1.0)
    assert size == pytest.approx(0.005, abs=0.0006)


def test_lags_that_turned_out_to_be_the_robot_s_are_not_given_back_to_its_readings(problem: Problem) -> None:
    """Else a search would go on as the one and then as the other, each time for as long as it takes."""
    late = problem.nominal().with_cause(GYRO_LATENCY, np.array([0.5]))
    search = cast(Search, SimpleNamespace(fit=SimpleNamespace(point=late), problem=problem))
    now = Habits(Chain.firmware(), brake=False)
    trials = HabitTrials(lambda habits: pytest.fail(f"{habits} is asked for"))
    trials.lags_of_robot.add(replace(now, low_pass=True))
    assert try_lagging_readings(search, now, trials) == (search, now)


def test_beside_two_causes_it_stays_the_chip_s() -> None:
    search, habits, trials = smoothed(SLIPS, Chain.firmware(), OTHERS[:1])
    assert try_lags_as_causes(search, habits, trials) == (search, habits)


def test_a_late_command_is_no_lag_of_the_gyro_s() -> None:
    """So two causes beside it are three, of which a slip may be a fourth: it was left to the chip."""
    search, habits, trials = smoothed(SLIPS, Chain.firmware(), (OTHERS[0], "actuation.latency"))
    found, now = try_lags_as_causes(search, habits, trials)
    assert not now.low_pass
    assert SLIP in found.fit.point.active


def test_a_controller_with_a_clock_of_its_own_keeps_it_beside_many_causes() -> None:
    own = Hidden("unknown", None, {}, {"own_cycle": 0.0053, "gyro_smooth": 0.0039, "imu_latency": 0.0025})
    search, habits, trials = smoothed(own, FREE_RUNNING, OTHERS)
    assert try_lags_as_causes(search, habits, trials) == (search, habits)


def test_a_lag_that_a_chip_is_clearly_ahead_of_is_the_chip_s() -> None:
    """Beside three causes a slip of 3 ms was named with a probability of 0.00 against the chip."""
    motor, *more = [draw(each, np.random.default_rng(8)) for each in (STRENGTH, *OTHERS)]
    chip = Hidden("unknown", None, {}, CHIP)
    named = {motor.name: np.sign(motor.values["factor"] - 1.0), **{each.name: 1.0 for each in more}}
    columns = make(8, [chip, motor, *more], seconds=16.0).columns
    search, trials = standing(columns, FIRMWARE, {**named, SLIP: 0.1}, AMONG)
    found, habits = try_low_pass_for_gyro_lag(search, FIRMWARE, trials)
    assert habits == replace(FIRMWARE, low_pass=True)
    assert found.fit.point.active.keys() == named.keys()


def test_a_lag_that_is_no_chip_s_stays_and_has_it_as_a_rival() -> None:
    slip = Hidden(SLIP, None, {"time": 0.012}, {"slip": 0.012})
    search, trials = standing(make(8, [slip], seconds=10.0).columns, FIRMWARE, {SLIP: 0.5}, AMONG)
    assert try_low_pass_for_gyro_lag(search, FIRMWARE, trials) == (search, FIRMWARE)
    (rival,) = search.rivals[SLIP]
    assert rival.name == "imu.low_pass"
    assert rival.lead > 0.0


def test_a_lag_is_fitted_on_before_a_chip_is_ahead_of_it() -> None:
    """A chip was 14 ahead of a slip whose fit had not arrived, which then led by 1."""
    slip = Hidden(SLIP, None, {"time": 0.006}, {"slip": 0.006})
    search, trials = standing(make(8, [slip], seconds=6.0).columns, FIRMWARE, {SLIP: 0.3}, AMONG)
    there = search.fit.point.with_cause(SLIP, 0.7 * search.fit.point.active[SLIP])
    early = replace(search, fit=evaluate_fit(search.problem, search.whitener, there))
    assert try_low_pass_for_gyro_lag(early, FIRMWARE, trials) == (early, FIRMWARE)


def test_of_two_forms_of_a_rival_the_nearer_one_counts() -> None:
    search = cast(Search, SimpleNamespace(rivals={GYRO_LATENCY: [Rival("a", 3.0), Rival(SLIP, 40.0)]}))
    note_rival(search, GYRO_LATENCY, SLIP, 1.0)
    assert search.rivals[GYRO_LATENCY] == [Rival(SLIP, 1.0), Rival("a", 3.0)]
    note_rival(search, GYRO_LATENCY, SLIP, 30.0)
    assert search.rivals[GYRO_LATENCY] == [Rival(SLIP, 1.0), Rival("a", 3.0)]
