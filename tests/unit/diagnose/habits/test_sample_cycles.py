"""How finely the filter of the wheels' readings runs, and what another way of it is compared by."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.habits.alternatives import MIN_LOG_EVIDENCE_LEAD, adopt_if_ahead, found_nothing
from raccoon.diagnose.habits.chains import CONTINUOUS_CYCLE_S
from raccoon.diagnose.habits.controller import find_habits, with_sample_cycle
from raccoon.diagnose.habits.notes import habit_notes
from raccoon.diagnose.habits.sample_cycles import (
    try_continuous_filter,
    try_pause_slowdown,
    try_pause_slowdown_beside_causes,
)
from raccoon.diagnose.habits.trials import HabitTrials
from raccoon.diagnose.hypotheses.base_coordinates import WheelSliding
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.diagnose.select.search import start_selection
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from simulated_drives import record_simulated_drive
from unit.diagnose.searches import standing

ROBOT = RobotConfig()
DEADBAND = "actuation.deadband"
NOTHING_FITTED = FitUncertainty(neutral_settings(ROBOT), (), np.zeros((0, 0)))
PLAIN = Habits(Chain(), False, sliding=WheelSliding.RIGID)
LATE = ("actuation.latency", "imu.latency", "bemf.filter_lag", "drive.")
"""What else is late."""


def test_a_filter_that_runs_all_the_time_is_no_late_command() -> None:
    """As whoever writes dy/dt = (x - y) / T has it: 2 ms later than T of the firmware's samples."""
    columns = record_simulated_drive(Parameters(ROBOT, {}, Chain(cycle=0.001)), 3.0)
    search, trials = standing(columns, PLAIN, {"actuation.latency": 0.08}, LATE)
    search, habits = try_continuous_filter(search, PLAIN, trials.running(start_selection))
    assert found_nothing(search)
    assert habits.chain.cycle == CONTINUOUS_CYCLE_S
    assert "with a continuous filter" in habit_notes(habits, (), NOTHING_FITTED)[0]


def test_a_later_command_is_no_filter_that_runs_all_the_time() -> None:
    """Gyro and battery are late as well."""
    late = Parameters(ROBOT, {("actuation.latency", None): {"seconds": 0.002}}, Chain())
    search, trials = standing(record_simulated_drive(late, 3.0), PLAIN, {"actuation.latency": 0.08}, LATE)
    search, habits = try_continuous_filter(search, PLAIN, trials.running(start_selection))
    assert habits == PLAIN
    assert not found_nothing(search)


@pytest.mark.parametrize("row", [0.0009999, 0.0008])
def test_rows_that_are_shorter_than_any_cycle_are_one_each(row: float) -> None:
    """Of 1000 Hz a recording was refused for a cycle that robot.toml does not even have."""
    time = row * np.arange(5000)
    columns = {"t": time, "motor.0.duty": np.sign(np.sin(9.0 * time)), "motor.1.duty": np.zeros(5000)}
    log = log_from_columns(columns | {"motor.0.bemf": 0.0 * time}, ROBOT)
    run = PlantRollout(log, ROBOT, with_sample_cycle(PLAIN, CONTINUOUS_CYCLE_S), plain=True)
    assert np.isfinite(run.samples([neutral_settings(ROBOT)])[0]).all()


@pytest.mark.parametrize(("causes", "taken"), [({}, True), ({"drive.inertia": 0.5}, False)])
def test_what_led_with_the_same_causes_leads(
    causes: dict[str, float], taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A point that was fitted under the noise of its own search is no best one under that of another: a sound
    robot was unknown over the speed, since what led by 75 as fitted there lacked 46 as it was."""
    columns = record_simulated_drive(Parameters(ROBOT, {}, Chain()), 3.0)
    fine = with_sample_cycle(PLAIN, CONTINUOUS_CYCLE_S)
    search, trials = standing(columns, PLAIN, {}, ["drive.inertia"])
    trials.started[fine], _ = standing(columns, fine, causes, ["drive.inertia"])
    monkeypatch.setattr(
        "raccoon.diagnose.habits.alternatives.net_lead", lambda *_: MIN_LOG_EVIDENCE_LEAD + 1.0
    )
    monkeypatch.setattr("raccoon.diagnose.habits.alternatives.lead_over_search", lambda *_: -43.0)
    _, habits = adopt_if_ahead(
        search, PLAIN, trials.running(start_selection), fine, trials.problem_of(fine), [search.fit.point]
    )
    assert (habits == fine) is taken


BEHIND = Habits(Chain.firmware(), False, sliding=WheelSliding.RIGID)
PAUSED = replace(BEHIND, chain=replace(Chain.firmware(), pause=0.0005))
SLOW = (DEADBAND, "friction.", "bemf.")
"""What else makes wheels slower where they are read."""


def test_wheels_that_a_pause_slows_down_have_no_deadband() -> None:
    """A motor that coasts before its sample is a count slower then, whichever way it turns."""
    search, trials = standing(
        record_simulated_drive(Parameters(ROBOT, {}, PAUSED.chain), 3.0), BEHIND, {DEADBAND: 0.05}, SLOW
    )
    search, habits = try_pause_slowdown(search, BEHIND, trials.running(start_selection))
    assert found_nothing(search)
    assert habits.chain.pause == pytest.approx(0.0005)
    assert "slower when they are read" in habit_notes(habits, (), NOTHING_FITTED)[0]


def test_a_deadband_is_no_wheel_that_a_pause_slows_down() -> None:
    narrow = Parameters(ROBOT, {(DEADBAND, None): {"duty": 0.01}}, Chain.firmware())
    search, trials = standing(record_simulated_drive(narrow, 3.0), BEHIND, {DEADBAND: 0.1}, SLOW)
    search, habits = try_pause_slowdown(search, BEHIND, trials.running(start_selection))
    assert habits == BEHIND
    assert not found_nothing(search)


def test_motors_that_never_coast_are_slowed_down_by_no_pause() -> None:
    search, trials = standing(
        record_simulated_drive(Parameters(ROBOT, {}, Chain()), 3.0), PLAIN, {DEADBAND: 0.05}, SLOW
    )
    assert try_pause_slowdown(search, PLAIN, trials.running(start_selection)) == (search, PLAIN)


@pytest.mark.parametrize(("ahead", "taken", "vain"), [(-1.0, False, 1), (5.0, False, 0), (11.0, True, 0)])
def test_beside_several_causes_a_search_goes_on_with_pauses_from_where_it_is(
    ahead: float, taken: bool, vain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It began from none, only to find them again: 14 s of a crowded drive."""
    point = SimpleNamespace(active={"actuation.latency": None, "imu.latency": None})
    features = SimpleNamespace(roles=("bemf_left", "bemf_right"))
    stub = SimpleNamespace(
        fit=SimpleNamespace(point=point), unknown={}, problem=SimpleNamespace(features=features)
    )
    search, there = cast(Search, stub), cast(Search, SimpleNamespace())
    problem = cast(Problem, SimpleNamespace())
    trials = HabitTrials(lambda _: problem)
    for name, said in (
        ("fit_best_start", stub.fit),
        ("net_lead", ahead),
        ("look_from", there),
        ("continue_selection", there),
    ):
        monkeypatch.setattr(f"raccoon.diagnose.habits.sample_cycles.{name}", lambda *_, said=said: said)
    found = try_pause_slowdown_beside_causes(search, BEHIND, trials)
    assert found == ((there, PAUSED) if taken else (search, BEHIND))
    assert len(trials.rejected) == vain
    assert try_pause_slowdown_beside_causes(search, PLAIN, trials) == (search, PLAIN)  # none that coasts


@pytest.mark.parametrize("chain", [PAUSED.chain, BEHIND.chain])
def test_whether_a_pause_slows_the_wheels_down_is_found_out_before_any_cause(chain: Chain) -> None:
    log = log_from_columns(record_simulated_drive(Parameters(ROBOT, {}, chain), 12.0), ROBOT)
    _, habits = find_habits(log, ROBOT, drive_causes(), None)
    assert habits.chain.pause == chain.pause
