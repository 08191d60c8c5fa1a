"""Commands that begin within the row before theirs, as a logger beside the program writes them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.habits.command_times import place_commands, with_earlier_commands
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

Array = NDArray[np.float64]
ROBOT = RobotConfig()
CAUSES = drive_causes()
ROW, SECONDS = 0.008, 9.0


def logged(within: bool, late: float = 0.0, row: float = ROW) -> tuple[Log, Array]:
    """A drive of a robot as robot.toml says, of rows of so many s, and when its commands changed. within:
    whether that is at any moment of a row. late: s by which readings are older than their rows, at most."""
    rng = np.random.default_rng(3)
    rows = row * np.arange(int(SECONDS / row))
    moments = np.arange(0.4, SECONDS - 0.4, 0.3)
    moments = moments + rng.uniform(0.0, 0.05, len(moments))
    moments = moments if within else row * np.ceil(moments / row)
    duties = rng.uniform(0.2, 0.9, (len(moments) + 1, 2)) * np.array([1.0, -0.8])
    duties[::2] *= -1.0
    read = rows - np.where(np.arange(len(rows)) > 0, rng.uniform(0.0, late, len(rows)), 0.0)
    time = np.unique(np.concatenate([0.001 * np.arange(1000.0 * SECONDS), read, moments]))
    given, written = (duties[np.searchsorted(moments, each + 1e-9)] for each in (time, rows))
    names = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
    commands = Commands.of_wheels(time, given[:, 0], given[:, 1], False)
    run = rollout([Parameters.from_robot(ROBOT)], commands, channels=names, longest_step=0.001)
    seen = np.searchsorted(time, read)
    columns = {name: run[name][0][seen] + 0.002 * rng.standard_normal(len(rows)) for name in names}
    columns |= {"t": rows, "motor.0.duty": written[:, 0], "motor.1.duty": written[:, 1]}
    return log_from_columns(columns, ROBOT), moments


def error(log: Log) -> float:
    """Counts, root mean square of both wheels, in the simulation of robot.toml."""
    problem = drive_problem(log, ROBOT, CAUSES, Habits(Chain(), False), None)
    residual = problem.features.measured - problem.predict([problem.nominal()])[0]
    return float(np.sqrt((residual[:, :2] ** 2).mean()))


def test_commands_begin_when_the_wheels_answer() -> None:
    log, moments = logged(within=True)
    better, found = place_commands(log, ROBOT, CAUSES, None)
    began = better.time[np.flatnonzero((np.diff(better.duty, axis=0) != 0.0).any(axis=1)) + 1]
    late = (
        began - moments
    )  # the wheels' readings are up to a cycle of 5 ms old, by half of that on the average
    assert late.min() > -0.0005
    assert late.max() < 0.003
    assert error(better) < 0.3 * error(log)
    assert found is not None
    (note,) = better.notes
    assert "Each is simulated from the moment that the wheels show; write rows from the driving" in note


def test_a_controller_as_slow_as_its_rows_is_left_alone() -> None:
    log, _ = logged(within=False)
    same, found = place_commands(log, ROBOT, CAUSES, None)
    assert same is log
    assert found is not None


@pytest.mark.parametrize("row", [0.005, 0.01])
def test_rows_of_whole_cycles_are_not_asked(row: float) -> None:
    log, _ = logged(within=True, row=row)
    same, found = place_commands(log, ROBOT, CAUSES, None)
    assert same is log
    assert found is None


def test_where_readings_are_of_other_moments_too_it_is_only_said() -> None:
    log, _ = logged(within=True, late=ROW)
    said, _ = place_commands(log, ROBOT, CAUSES, None)
    np.testing.assert_array_equal(said.duty, log.duty)
    (note,) = said.notes
    assert "as if a logger with a clock of its own wrote the rows" in note
    assert "simulated" not in note


def test_a_command_may_begin_before_its_row_or_after_it() -> None:
    log, _ = logged(within=False)
    rows = np.flatnonzero((np.diff(log.duty, axis=0) != 0.0).any(axis=1))[:2] + 1
    moved = with_earlier_commands(log, rows, np.array([0.25, -0.5]))
    assert len(moved.time) == len(log.time) + 2
    began = np.flatnonzero((np.diff(moved.duty, axis=0) != 0.0).any(axis=1))[:2] + 1
    np.testing.assert_allclose(moved.time[began], log.time[rows] - ROW * np.array([0.25, -0.5]))
    assert all(np.isnan(each.values[began]).all() for each in moved.channels)
    np.testing.assert_array_equal(moved.duty[np.isin(moved.time, log.time)][rows[1]], log.duty[rows[0]])
