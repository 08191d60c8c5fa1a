"""Whether motors brake at duty 0, where a recording says so."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.drives.log_joining import join_logs
from raccoon.diagnose.habits.lost_commands import LostChange, with_change_at
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from simulated_drives import NOISE

ROBOT = RobotConfig()
TIME = 0.005 * np.arange(3600)


def stops(braking: np.ndarray) -> dict[str, np.ndarray]:
    """Full power for half a second, rest for as long, to both sides; braking: of each row."""
    duty = np.where(TIME % 1.0 < 0.5, 0.8, 0.0) * np.where(TIME % 4.0 < 2.0, 1.0, -0.6)
    left, right = duty, np.where(TIME % 3.0 < 1.0, 0.6 * duty, duty)
    commands = Commands.of_wheels(TIME, left, right, braking)
    run = rollout([Parameters.from_robot(ROBOT)], commands, channels=tuple(NOISE), longest_step=0.001)
    rng = np.random.default_rng(7)
    columns = {name: run[name][0] + size * rng.standard_normal(len(TIME)) for name, size in NOISE.items()}
    return columns | {"t": TIME, "motor.0.duty": left, "motor.1.duty": right}


def said(braking: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of a recording that says it: a row without a word does not brake."""
    return {f"motor.{port}.brake": np.where(braking, 1.0, np.nan) for port in (0, 1)}


def simulated(log: Log, brake: bool, past: bool = False) -> np.ndarray:
    habits = Habits(Chain.firmware(), brake, past)
    return PlantRollout(log, ROBOT, habits, plain=True).samples([neutral_settings(ROBOT)])


@pytest.mark.parametrize("past", [False, True])
def test_rows_decide_where_they_say(past: bool) -> None:
    every = np.ones(len(TIME), bool)
    columns = stops(every)
    silent = log_from_columns(columns, ROBOT)
    assert silent.brake is None
    log = log_from_columns(columns | said(every), ROBOT)
    for habit in (False, True):
        assert np.array_equal(simulated(log, habit, past), simulated(silent, True, past))
    half = log_from_columns(columns | said(TIME < 9.0), ROBOT)
    early = TIME < 8.9
    one, other = simulated(half, False), simulated(silent, True)
    assert np.array_equal(one[..., early], other[..., early])
    assert np.abs(one - other)[..., ~early].max() > 100.0  # counts: it rolls on
    part = half.between(8.0, 10.0)
    assert part.brake is not None
    assert len(part.brake) == len(part.time)


def test_a_row_that_was_lost_is_as_the_one_after_it() -> None:
    braking = TIME < 9.0
    log = log_from_columns(stops(braking) | said(braking), ROBOT)
    wider = with_change_at(log, LostChange(1800, (8.9975,)), 8.9975)
    assert wider.brake is not None
    assert len(wider.brake) == len(wider.time)
    assert not wider.brake[1800].any()


def test_of_several_recordings_each_has_its_own_stops() -> None:
    """One that never braked has no word of it, and what the other says was forgotten: both were simulated as
    if nothing ever braked, and something was loose."""
    every = np.ones(len(TIME), bool)
    logs = [log_from_columns(each, ROBOT) for each in (stops(every) | said(every), stops(~every))]
    both = join_logs(logs)
    assert both.brake is not None
    second = both.time >= both.runs[1].start
    assert both.brake[~second].all()
    assert not both.brake[second].any()
    unsaid = join_logs(
        [log_from_columns(stops(every) | said(every), ROBOT), log_from_columns(stops(every), ROBOT)]
    )
    assert unsaid.brake is not None
    assert unsaid.brake.all()


def test_a_row_without_a_command_brakes_as_the_one_before() -> None:
    """As for raccoon replay. Where a logger writes commands as they change each stop braked for a row."""
    braking = TIME % 4.0 < 2.0
    columns = stops(braking) | said(braking)
    wanted = log_from_columns(columns, ROBOT)
    seldom = {name: each.copy() for name, each in columns.items()}
    for port in (0, 1):
        duty, brake = seldom[f"motor.{port}.duty"], seldom[f"motor.{port}.brake"]
        same = np.append(False, (np.diff(duty) == 0.0) & (braking[1:] == braking[:-1]))
        duty[same] = brake[same] = np.nan
    log = log_from_columns(seldom, ROBOT)
    assert log.brake is not None
    assert wanted.brake is not None
    assert np.array_equal(log.duty, wanted.duty)
    assert np.array_equal(log.brake, wanted.brake)
