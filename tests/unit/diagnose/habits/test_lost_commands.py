"""Commands that changed in rows which a recording lost."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.habits import problems
from raccoon.diagnose.habits.lost_commands import find_lost_changes, restore_lost_changes, with_change_at
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from simulated_drives import SIMULATED_CONTROLLER

Array = NDArray[np.float64]
ROBOT = RobotConfig()
ROW = 0.005
EVERY = 80
"""Rows between two changes of the command."""


def drive(seconds: float, seed: int = 1) -> dict[str, Array]:
    """A drive of a robot as robot.toml says, without noise: both wheels reverse every 0.4 s."""
    rng = np.random.default_rng(seed)
    count = int(seconds / ROW)
    steps = rng.uniform(0.2, 0.9, (count // EVERY + 1, 2)) * np.array([1.0, -0.8])
    steps[::2] *= -1.0
    duty = np.repeat(steps, EVERY, axis=0)[:count]
    time = ROW * np.arange(count)
    names = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
    commands = Commands.of_wheels(time, duty[:, 0], duty[:, 1], False)
    run = rollout([Parameters.from_robot(ROBOT)], commands, channels=names, longest_step=0.001)
    columns = {name: run[name][0] for name in names}
    return columns | {"t": time, "motor.0.duty": duty[:, 0], "motor.1.duty": duty[:, 1]}


def without(columns: dict[str, Array], rows: list[int]) -> dict[str, Array]:
    return {name: np.delete(each, rows) for name, each in columns.items()}


def nominal(log: Log) -> Problem:
    return drive_problem(log, ROBOT, drive_causes(), Habits(Chain(), False), None)


def error(log: Log) -> float:
    """Counts, root mean square of both wheels."""
    problem = nominal(log)
    residual = problem.features.measured - problem.predict([problem.nominal()])[0]
    return float(np.sqrt((residual[:, :2] ** 2).mean()))


def put_back(log: Log) -> Log:
    return restore_lost_changes(log, nominal, nominal(log).nominal())


@pytest.mark.parametrize("before", [0, 1, 2])
@pytest.mark.parametrize("after", [1, 2])
def test_a_change_is_put_back_into_the_row_that_was_lost(before: int, after: int) -> None:
    """Its own row, so many before it and one or two in all from it on are lost."""
    columns = drive(4.0)
    change = 4 * EVERY
    lost = list(range(change - before, change + after))
    log = log_from_columns(without(columns, lost), ROBOT)
    assert error(log) > 2.0 * error(log_from_columns(columns, ROBOT))
    found = put_back(log)
    assert len(found.time) == len(log.time) + 1
    assert found.time[change - before] == pytest.approx(columns["t"][change], abs=1e-9)
    np.testing.assert_array_equal(found.duty[change - before], log.duty[change - before])
    assert error(found) < 1.05 * error(log_from_columns(columns, ROBOT))
    (note,) = found.notes
    assert note.startswith("the recording lost a row in which a command changed")
    assert "changed at 1.60 s" in note


def test_several_changes_are_put_back() -> None:
    columns = drive(8.0, seed=2)
    changes = [2 * EVERY, 7 * EVERY, 8 * EVERY, 15 * EVERY]
    found = put_back(log_from_columns(without(columns, changes), ROBOT))
    assert np.isin(np.round(columns["t"][changes], 6), np.round(found.time, 6)).all()
    assert error(found) < 1.05 * error(log_from_columns(columns, ROBOT))


def test_a_row_that_is_put_in_makes_no_other_bins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bins are as long as commands hold: in 2 of 20 drives by a loop it made one more, and an IndexError."""
    columns = drive(4.0)
    log = log_from_columns(without(columns, [4 * EVERY]), ROBOT)
    monkeypatch.setattr(
        problems, "bin_width", lambda each: 0.01 if len(each.time) == len(log.time) else 0.011
    )
    found = put_back(log)
    assert found.time[4 * EVERY] == pytest.approx(columns["t"][4 * EVERY], abs=1e-9)


def test_a_command_that_a_late_loop_sent_stays_in_its_row() -> None:
    """No row was lost there: none was made, and the old command held on."""
    columns = drive(4.0, seed=3)
    time = columns["t"]
    kept = np.delete(np.arange(len(time)), 3 * EVERY - 1)
    duty = np.column_stack([columns["motor.0.duty"], columns["motor.1.duty"]])[kept]
    commands = Commands.of_wheels(time[kept], duty[:, 0], duty[:, 1], False)
    names = ("motor.0.bemf", "motor.1.bemf")
    run = rollout([Parameters.from_robot(ROBOT)], commands, channels=names, longest_step=0.001)
    late = without(columns, [3 * EVERY - 1]) | {name: run[name][0] for name in names}
    log = log_from_columns(late, ROBOT)
    assert len(find_lost_changes(log)) == 1
    assert put_back(log) is log


def test_nothing_is_lost_where_no_row_is_missing_or_no_command_changed() -> None:
    columns = drive(4.0)
    assert find_lost_changes(log_from_columns(columns, ROBOT)) == []
    assert find_lost_changes(log_from_columns(without(columns, [4 * EVERY + 20]), ROBOT)) == []


def test_a_part_of_a_ramp_a_pause_and_rows_without_a_clock_are_left_alone() -> None:
    columns = drive(4.0)
    ramp = np.linspace(-0.9, 0.9, len(columns["t"]))
    ramped = columns | {"motor.0.duty": ramp, "motor.1.duty": ramp}
    assert find_lost_changes(log_from_columns(without(ramped, [100]), ROBOT)) == []
    pause = list(range(4 * EVERY - 20, 4 * EVERY + 20))
    assert find_lost_changes(log_from_columns(without(columns, pause), ROBOT)) == []
    log = log_from_columns(without(columns, [4 * EVERY]), ROBOT)
    shaken = log.time + np.random.default_rng(1).uniform(-0.4, 0.4, len(log.time)) * ROW
    assert find_lost_changes(replace(log, time=shaken)) == []


def test_the_row_that_is_put_in_reads_nothing() -> None:
    log = log_from_columns(without(drive(4.0), [4 * EVERY]), ROBOT)
    (change,) = find_lost_changes(log)
    assert change.row == 4 * EVERY
    found = with_change_at(log, change, change.moments[0])
    for before, after in zip(log.channels, found.channels, strict=True):
        assert np.isnan(after.values[change.row])
        np.testing.assert_array_equal(np.delete(after.values, change.row), before.values)


def test_a_recording_with_lost_changes_is_as_good_as_one_without() -> None:
    """Each would be an error of some 80 counts, which no number of the robot explains."""
    columns = drive(8.0, seed=4)
    rng = np.random.default_rng(4)
    noise = {"motor.0.bemf": 4.0, "motor.1.bemf": 4.0, "imu.gyro.z": 0.009, "battery.voltage": 0.02}
    noisy = columns | {
        name: columns[name] + each * rng.standard_normal(len(columns["t"])) for name, each in noise.items()
    }
    lost = [each * EVERY for each in range(2, 19, 3)]
    whole, part = (
        diagnose(each, ROBOT, firmware=SIMULATED_CONTROLLER) for each in (noisy, without(noisy, lost))
    )
    assert whole.causes == part.causes == ()
    assert any("lost rows in which commands changed" in each for each in part.notes)
    for one, other in zip(whole.channels, part.channels, strict=True):
        assert other.rmse_after < 1.1 * one.rmse_after
