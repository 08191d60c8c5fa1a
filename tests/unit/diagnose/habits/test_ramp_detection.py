"""Ramps between commands and motors, of which no column tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from blind.generator import Noise, make
from blind.hidden import Hidden, draw
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.drives.ramp import Ramp
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.habits.controller import find_habits
from raccoon.diagnose.habits.notes import habit_notes
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

Array = NDArray[np.float64]
ROBOT = RobotConfig()
NOTHING_FITTED = FitUncertainty(neutral_settings(ROBOT), (), np.zeros((0, 0)))
EVERY_ROW = replace(Noise(), drop_share=0.0)


def limited(duty: Array, rate: float, soft: bool) -> Array:
    """What a driver gives that changes by so much a second; soft: only where it drives more."""
    given, before, most = np.zeros_like(duty), np.zeros(2), 0.005 * rate
    for row, asked in enumerate(duty):
        held = np.where(before * asked < 0.0, 0.0, before) if soft else before
        before = held + np.clip(asked - held, -most, most)
        if soft:
            less = np.abs(asked) < np.abs(held)
            before[less] = asked[less]
        given[row] = before
    return given


def seen_behind(rate: float, soft: bool, *hidden: Hidden) -> Ramp | None:
    """What is found of an independent robot whose log has what was asked of such a driver."""
    asked = exciting(np.random.default_rng(4), 6.0)
    given = limited(asked, rate, soft)
    columns = dict(make(4, hidden, drive=given, noise=EVERY_ROW).columns)
    rows = np.cumsum(np.rint(np.diff(columns["t"], prepend=columns["t"][0]) / 0.005)).astype(int)
    for port in (0, 1):
        np.testing.assert_allclose(columns[f"motor.{port}.duty"], given[rows, port], atol=1e-4)
        columns[f"motor.{port}.duty"] = asked[rows, port]
    return find_habits(log_from_columns(columns, ROBOT), ROBOT, drive_causes(), None)[1].ramp


def test_a_ramp_follows_by_so_much_a_second() -> None:
    time = np.array([0.0, 0.1, 0.2, 0.4, 0.5, 0.6])
    duty = np.array([0.0, 0.5, 0.5, 0.5, -0.5, 0.0])[:, None]
    assert Ramp(2.0).given(time, duty)[:, 0] == pytest.approx([0.0, 0.2, 0.4, 0.5, 0.3, 0.1])
    assert Ramp(2.0, soft=True).given(time, duty)[:, 0] == pytest.approx([0.0, 0.2, 0.4, 0.5, -0.2, 0.0])


@pytest.mark.parametrize(("rate", "soft"), [(6.0, False), (12.0, True)])
def test_a_ramp_that_no_column_tells_of_is_found_out(rate: float, soft: bool) -> None:
    """It was a limit of the current, stiction, a latency, a deadband and five more."""
    found = seen_behind(rate, soft, draw("actuation.latency", np.random.default_rng(4)))
    assert found is not None
    assert found.soft == soft
    assert found.rate == pytest.approx(rate, rel=0.03)


def test_a_limit_of_the_current_is_no_ramp() -> None:
    assert seen_behind(1000.0, False, draw("motor.current_limit", np.random.default_rng(4))) is None


def test_motors_that_brake_at_their_few_stops_are_behind_no_ramp() -> None:
    """Coasting ones stop as these behind a ramp, and in smooth driving nothing else tells."""
    time = 0.005 * np.arange(1600)
    arcs = np.column_stack([0.6 - 0.3 * np.sin(0.7 * time), 0.6 + 0.3 * np.sin(0.7 * time)])
    drive = np.where(((time > 0.5) & (time < 4.0))[:, None], arcs, 0.0)
    drive[(time > 5.0) & (time < 7.5)] = -arcs[(time > 5.0) & (time < 7.5)]
    commands = Commands.of_wheels(time, drive[:, 0], drive[:, 1], True)
    names = tuple(f"motor.{port}.bemf" for port in (0, 1))
    run = rollout([Parameters.from_robot(ROBOT)], commands, channels=names, longest_step=0.001)
    rng = np.random.default_rng(4)
    columns = {"t": time, **{f"motor.{port}.duty": drive[:, port] for port in (0, 1)}}
    columns |= {name: run[name][0] + 2.0 * rng.standard_normal(len(time)) for name in names}
    habits = find_habits(log_from_columns(columns, ROBOT), ROBOT, drive_causes(), None)[1]
    assert habits.ramp is None
    assert habits.brake


def test_a_ramp_is_said() -> None:
    at_once = Habits(Chain.firmware(), False)
    (hard,) = habit_notes(replace(at_once, ramp=Ramp(6.0)), (), NOTHING_FITTED)
    (soft,) = habit_notes(replace(at_once, ramp=Ramp(6.0, soft=True)), (), NOTHING_FITTED)
    assert "a ramp of 6 a second" in hard
    assert "starts softly" in soft
    assert "starts softly" not in hard
