"""Speeds that a board counts over a window."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Channel, Log
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.habits.habit_fits import choose_start
from raccoon.diagnose.habits.problems import drive_problem, free_problem_of
from raccoon.diagnose.rollout.encoder_window import (
    WINDOW,
    average_over_window,
    encoder_coordinates,
    encoder_settings,
)
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain

TIME = np.arange(0.0, 2.0, 0.005)


@pytest.mark.parametrize("window", [0.002, 0.005, 0.012, 0.04])
def test_a_count_is_half_its_window_late(window: float) -> None:
    later = TIME[window < TIME]
    speeds = np.stack([3.0 * TIME, np.sin(5.0 * TIME)])
    found = average_over_window(TIME, speeds, np.array([window, window]))[:, -len(later) :]
    means = (np.cos(5.0 * (later - window)) - np.cos(5.0 * later)) / (5.0 * window)
    np.testing.assert_allclose(found[0], 3.0 * (later - 0.5 * window), atol=1e-12)
    np.testing.assert_allclose(found[1], means, atol=1e-4)


def test_no_window_changes_nothing_and_a_robot_at_its_start_was_as_fast_before() -> None:
    speeds = np.array([np.cos(TIME), np.cos(TIME), np.full_like(TIME, 2.0)])
    found = average_over_window(TIME, speeds, np.array([0.0, 1e-3, 0.03]))
    assert (found[0] == speeds[0]).all()
    np.testing.assert_allclose(found[1], speeds[1], atol=1e-3)
    np.testing.assert_allclose(found[2], 2.0, rtol=1e-12)


def encoders() -> Log:
    log = planned_log(exciting(np.random.default_rng(1), 4.0))
    speeds = tuple(
        Channel(f"motor.{port}.speed", f"speed_{side}", "rad/s", np.zeros_like(log.time), 0.01)
        for port, side in enumerate(("left", "right"))
    )
    return replace(log, channels=(*speeds, *(each for each in log.channels if each.role == "gyro")))


def test_the_window_of_encoders_is_open_and_delays_their_speeds_alone() -> None:
    robot, log = RobotConfig(), encoders()
    problem = drive_problem(log, robot, (), Habits(Chain(), brake=False), None)
    (index,) = (place for place, each in enumerate(problem.base) if each.settings == (WINDOW,))
    usual = problem.nominal()
    assert problem.settings(usual)[WINDOW] == pytest.approx(0.005)
    base = usual.base.copy()
    base[index] = 1.5
    later = replace(usual, base=base)
    assert problem.settings(later)[WINDOW] == pytest.approx(0.02)
    before, after = problem.predict([usual, later])
    roles = problem.features.roles
    gyro = roles.index("gyro")
    assert (before[:, gyro] == after[:, gyro]).all()
    assert np.abs(before - after)[:, roles.index("speed_left")].max() > 0.05


def test_back_emf_has_no_window() -> None:
    log = planned_log(exciting(np.random.default_rng(1), 4.0))
    assert encoder_coordinates(log) == ()
    assert encoder_settings(log) == {}


@pytest.mark.parametrize("window", [0.005, 0.02])
def test_a_fit_for_the_habits_starts_from_the_window_that_is_nearer(window: float) -> None:
    """From a row a latency took half of 20 ms, and another chain explained the rest: a resistance of 0.9."""
    robot, log, habits = RobotConfig(), encoders(), Habits(Chain(), brake=False)
    problem = free_problem_of(robot, (), habits, None)(log)
    (index,) = (place for place, each in enumerate(problem.base) if each.settings == (WINDOW,))
    base = problem.nominal().base.copy()
    base[index] = (window - 0.005) / 0.01
    measured = problem.predict([replace(problem.nominal(), base=base)])[0]
    seen = replace(problem, features=replace(problem.features, measured=measured))
    assert seen.settings(choose_start(seen))[WINDOW] == pytest.approx(window)
