"""Samples of any moment in a row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.habits.chains import FREE_RUNNING
from raccoon.diagnose.habits.controller import find_habits
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.rollout.firmware import FIRMWARES
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.rollout.sample_ages import SAMPLE_AGE, age_coordinates, samples_at_age
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from simulated_drives import record_simulated_drive

ROBOT = RobotConfig()
TIME = np.arange(0.0, 1.0, 0.005)


def test_a_reading_is_what_it_was_so_long_ago_and_will_be_so_much_later() -> None:
    samples = np.stack([3.0 * TIME, 3.0 * TIME, np.sin(6.0 * TIME)])
    found = samples_at_age(TIME, samples, np.array([0.002, -0.0015, 0.0025]))[:, 1:-1]
    within = TIME[1:-1]
    np.testing.assert_allclose(found[0], 3.0 * (within - 0.002), atol=1e-12)
    np.testing.assert_allclose(found[1], 3.0 * (within + 0.0015), atol=1e-12)
    np.testing.assert_allclose(found[2], np.sin(6.0 * (within - 0.0025)), atol=2e-4)
    assert samples_at_age(TIME, samples, np.zeros(3)) is samples


def test_half_a_cycle_either_way_is_open_and_moves_one_wheels_readings_alone() -> None:
    assert [each.value(each.high) for each in age_coordinates()] == pytest.approx([0.0025, 0.0025], rel=0.02)
    log = planned_log(exciting(np.random.default_rng(1), 3.0))
    problem = drive_problem(log, ROBOT, (), Habits(FREE_RUNNING, brake=False, fits_sample_ages=True), None)
    usual = problem.nominal()
    (index,) = (place for place, each in enumerate(problem.base) if each.settings == (SAMPLE_AGE["right"],))
    base = usual.base.copy()
    base[index] = 1.0
    before, after = problem.predict([usual, replace(usual, base=base)])
    moved = {
        role for role, each in zip(problem.features.roles, (after - before).T, strict=True) if each.any()
    }
    assert moved == {"bemf_right"}


def test_of_a_firmware_that_is_named_nothing_of_it_is_open() -> None:
    log = planned_log(exciting(np.random.default_rng(1), 1.0))
    stock = FIRMWARES["wombat-stock"]
    problem = drive_problem(log, ROBOT, (), Habits(stock.chain, brake=False, firmware=stock), None)
    assert not {each.settings[0] for each in problem.base} & set(SAMPLE_AGE.values())


def test_samples_of_another_moment_are_no_other_filter() -> None:
    """Of a controller in step with its rows, which samples 1.8 and 1.2 ms before each: a plain filter and a
    latency of 5 ms were found, and then a gear that loses torque, or a slip, of sound robots."""
    columns = record_simulated_drive(
        Parameters(ROBOT, {}, Chain.firmware()),
        7.0,
        noise=dict.fromkeys(("motor.0.bemf", "motor.1.bemf"), 0.0),
    )
    noise = np.random.default_rng(5)
    for port, sooner in ((0, 0.00195), (1, 0.0013)):
        name = f"motor.{port}.bemf"
        later = np.interp(columns["t"] + sooner, columns["t"], columns[name])
        columns[name] = later + noise.normal(0.0, 2.0, later.shape)
    _, habits = find_habits(log_from_columns(columns, ROBOT), ROBOT, drive_causes(), None)
    assert habits.chain.median
    assert habits.chain.free_running
