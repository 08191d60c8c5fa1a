"""That motors coast while they are sampled is the same drive with less resistance: of whom it is asked."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

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
from raccoon.diagnose.habits.trials import HabitTrials
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
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
    problem = SimpleNamespace(causes=CAUSES, features=SimpleNamespace(roles=roles))
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
