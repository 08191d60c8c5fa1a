"""That motors coast while they are sampled is the same drive with less resistance: of whom it is asked."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.alternatives import MIN_LOG_EVIDENCE_LEAD
from raccoon.diagnose.habits.chain_trials import try_sensor_chains
from raccoon.diagnose.habits.chains import (
    FREE_RUNNING,
    MEDIAN_AT_CYCLE_END,
    PAUSING_AT_CYCLE_END,
    pauses_at_cycle_end,
)
from raccoon.diagnose.habits.habit_fits import choose_start
from raccoon.diagnose.habits.notes import habit_notes
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.habits.trials import HabitTrials
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.result import ParameterResult
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.chain import Chain

CAUSES = {each.name: each for each in drive_causes() if each.name == "actuation.latency"}
NAMED = ("motor.armature_resistance", "friction.stiction")
BACK_EMF, ENCODERS = ("bemf_left", "bemf_right", "gyro"), ("speed_left", "speed_right", "gyro")


def asked(
    chain: Chain, roles: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, named: tuple[str, ...] = NAMED
) -> dict[Chain, Any]:
    """Which filters are asked for, each with the lead that it must have what its starts name, and whether
    with a gyro that smooths; the last with a filter counts."""
    found: dict[Chain, Any] = {}

    def note(
        search: Search, habits: Habits, _: HabitTrials, other: Habits, *rest: Any
    ) -> tuple[Search, Habits]:
        _, starts, far, wanted = rest
        found[other.chain] = (far, wanted, [tuple(each.active) for each in starts], other.low_pass)
        return search, habits

    monkeypatch.setattr("raccoon.diagnose.habits.chain_trials.adopt_if_ahead", note)
    point = Point(np.zeros(1), {name: np.ones(1) for name in named})
    problem = SimpleNamespace(causes=CAUSES, base=(), features=SimpleNamespace(roles=roles))
    search = SimpleNamespace(fit=SimpleNamespace(point=point), unknown=(), problem=problem)
    trials = HabitTrials(lambda _: cast(Any, problem))
    try_sensor_chains(cast(Search, search), Habits(chain, False), trials)
    return found


def test_a_pause_is_asked_for_where_all_motors_are_sampled_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    found = asked(MEDIAN_AT_CYCLE_END, BACK_EMF, monkeypatch)
    assert found[PAUSING_AT_CYCLE_END] == (0.0, 0.0, [NAMED, NAMED[1:]], False)
    assert found[FREE_RUNNING][:2] == (MIN_LOG_EVIDENCE_LEAD, MIN_LOG_EVIDENCE_LEAD)
    for chain in (Chain.firmware(), Chain(), FREE_RUNNING):
        assert PAUSING_AT_CYCLE_END not in asked(chain, BACK_EMF, monkeypatch)


def test_encoders_are_asked_for_the_pause_of_the_firmware_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock of the controller's own brought its pause along, and a resistance 10 % low with that."""
    found = asked(Chain(), ENCODERS, monkeypatch)
    assert found[Chain.firmware()] == (0.0, 0.0, [NAMED, NAMED[1:]], False)
    assert [each.coast_share for each in found if each != Chain.firmware()] == [0.0, 0.0]
    assert replace(FREE_RUNNING, coast_share=0.0) in found


def test_a_pause_is_asked_for_with_the_twins_of_what_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a gyro that read 5 % too much, K_E of both motors was the likeliest twin without the pause, and the
    gyro with it. With K_E kept the pause was 2 behind, and K_E was named with a probability of 1."""
    starts: list[Point] = []

    def note(search: Search, habits: Habits, *rest: Any) -> tuple[Search, Habits]:
        if pauses_at_cycle_end(rest[1].chain):
            starts.extend(rest[3])
        return search, habits

    monkeypatch.setattr("raccoon.diagnose.habits.chain_trials.adopt_if_ahead", note)
    habits = Habits(MEDIAN_AT_CYCLE_END, False)
    log = planned_log(exciting(np.random.default_rng(1), 2.0))
    problem = drive_problem(log, RobotConfig(), drive_causes(), habits, None)
    point = problem.nominal().with_cause("motor.back_emf_constant", np.array([-0.7]))
    search = SimpleNamespace(fit=SimpleNamespace(point=point), unknown=(), problem=problem)
    try_sensor_chains(cast(Search, search), habits, HabitTrials(lambda _: problem))
    twins = [each for each in starts if "motor.back_emf_constant" not in each.active]
    assert [[*each.active] for each in twins] == [["drive.track_width"]]
    gyro = problem.features.roles.index("gyro")
    nominal, named, twin = problem.predict([problem.nominal(), point, *twins])[:, -1, gyro]
    assert twin == pytest.approx(named, rel=0.001)  # at a steady speed: more inertia is left to the pause
    assert nominal != pytest.approx(named, rel=0.03)


def test_what_a_pause_would_change_is_said_where_a_resistance_is_named() -> None:
    """A motor that is driven nine tenths of the time has the current of one with a ninth more resistance."""
    number = ParameterResult(1.3, 0.03, "", 1.0)
    cause: Any = SimpleNamespace(name="motor.armature_resistance", parameters={"factor": number})
    nothing = FitUncertainty(neutral_settings(RobotConfig()), (), np.zeros((0, 0)))
    (said,) = habit_notes(Habits(MEDIAN_AT_CYCLE_END, False), (cause,), nothing)
    assert "with a resistance of 1.17 times" in said
    (paused,) = habit_notes(Habits(PAUSING_AT_CYCLE_END, False), (cause,), nothing)
    assert "with a resistance of" not in paused


@pytest.mark.parametrize("seconds", [0.0, 0.1])
def test_a_pause_is_one_with_any_filter_of_the_battery(seconds: float) -> None:
    assert pauses_at_cycle_end(replace(PAUSING_AT_CYCLE_END, battery_time_constant=seconds))
    assert not pauses_at_cycle_end(replace(MEDIAN_AT_CYCLE_END, battery_time_constant=seconds))


def test_a_median_and_a_chip_are_asked_for_at_once_where_late_commands_were_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A limit of the current hid the median, and a latency of 4.7 ms stood for it and for the chip."""
    named = ("motor.current_limit", "actuation.latency", "motor.armature_resistance")
    found = asked(Chain(), BACK_EMF, monkeypatch, named)
    without = [(named[0], named[2]), named[:1]]
    starts = [*without, named, named[:2]]
    assert found[PAUSING_AT_CYCLE_END] == found[MEDIAN_AT_CYCLE_END] == (0.0, 0.0, starts, True)
    for chain, roles in ((Chain.firmware(), BACK_EMF), (Chain(), ENCODERS)):
        assert not any(each[-1] for each in asked(chain, roles, monkeypatch, named).values())
    assert not any(each[-1] for each in asked(Chain(), BACK_EMF, monkeypatch).values())


def test_a_channel_that_any_start_has_right_decides_no_start() -> None:
    """A battery without resistance reads the same at any latency: 0 of 0 made the first the best."""

    def predict(points: list[Point]) -> np.ndarray:
        late = np.array([each.active["actuation.latency"][0] for each in points])
        wheel = np.sin(np.arange(40) / 5.0 - late[:, None])
        return np.stack([wheel, np.full_like(wheel, 12.0)], axis=2)

    measured = predict([Point(np.zeros(1), {"actuation.latency": np.array([1.6])})])[0]
    problem = SimpleNamespace(
        causes=CAUSES,
        base=(),
        features=SimpleNamespace(measured=measured),
        nominal=lambda: Point(np.zeros(1)),
        predict=predict,
    )
    found = choose_start(cast(Problem, problem))
    assert found.active["actuation.latency"].tolist() == [1.7]
