"""What of the friction that a recording shows is the robot's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.findings.floor_friction import friction_line_covariance, without_floor_friction
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.base_coordinates import WHEEL_STD_SHARE

FRICTION = RobotConfig().model.friction
COULOMB, VISCOUS = "friction.coulomb", "friction.viscous"
TIME = np.asarray(0.02 * np.arange(1500), float)


def test_what_no_floor_does_is_kept(problem: Problem) -> None:
    point = Point(np.random.default_rng(4).standard_normal(len(problem.base)), {"drive.inertia": np.ones(1)})
    still = without_floor_friction(problem, point, 0.0)
    assert still.base == pytest.approx(point.base, abs=1e-9)
    assert still.active == point.active
    kept = [i for i, each in enumerate(problem.base) if each.settings[0][0] not in (COULOMB, VISCOUS)]
    assert (without_floor_friction(problem, point, 0.04).base[kept] == point.base[kept]).all()


def test_without_speeds_the_mean_of_what_the_floor_did_is_left_out() -> None:
    """Covariance of the mean of an Ornstein-Uhlenbeck process, from its correlation."""
    covariance = friction_line_covariance(TIME, np.zeros(len(TIME)))
    expected = np.exp(-np.abs(TIME[:, None] - TIME[None]) / 4.0).mean()
    assert covariance[0, 0] == pytest.approx(expected, rel=0.02)
    assert covariance[0, 1] == covariance[1, 1] == 0.0


def test_the_line_through_a_floor_varies_as_drawn_lines_do() -> None:
    rng, draws = np.random.default_rng(5), 2000
    speed = 10.0 * np.sin(0.5 * TIME) * np.sin(3.1 * TIME)
    moves = np.abs(speed) >= 0.03 * np.abs(speed).max()
    keep = np.exp(-0.02 / 4.0)
    floor = np.empty((len(TIME), draws))
    floor[0] = rng.standard_normal(draws)
    for row in range(1, len(TIME)):
        floor[row] = keep * floor[row - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal(draws)
    slope, level = np.polyfit(np.abs(speed[moves]), floor[moves], 1)
    found, drawn = friction_line_covariance(TIME, speed), np.cov(level, slope)
    assert found == pytest.approx(drawn, rel=0.12)
    assert found[0, 1] < 0.0


def test_a_number_is_expected_as_a_regression_on_what_is_found_says(problem: Problem) -> None:
    """Of robots as in robot.toml on floors of `friction_line_covariance` a fit finds the sum of both. What is
    left of it is the best estimate of the robot's: its error is independent of it."""
    wander, model = 0.05, RobotConfig().model
    places = {
        (each.settings[0][0], each.settings[0][1] if len(each.settings) == 1 else None): index
        for index, each in enumerate(problem.base)
        if each.settings[0][0] in (COULOMB, VISCOUS)
    }
    lines, left, floor = [], [], np.zeros((len(places), len(places)))
    for at in places.values():  # what is left is linear in what is found
        base = np.zeros(len(problem.base))
        base[at] = 1.0
        lines.append(_lines(base, places))
        left.append(_lines(without_floor_friction(problem, Point(base), wander).base, places))
    for side in ("left", "right"):
        counts = problem.features.measured[:, problem.features.roles.index(f"bemf_{side}")]
        speed = counts * BEMF_VOLTS_PER_COUNT / getattr(model, side).back_emf_constant.value
        stds = WHEEL_STD_SHARE * np.array([FRICTION.coulomb.std, FRICTION.viscous.std])
        rows = [list(places).index((id_, side)) for id_ in (COULOMB, VISCOUS)]
        line = (wander * FRICTION.coulomb.value) ** 2 * friction_line_covariance(problem.features.time, speed)
        floor[np.ix_(rows, rows)] = line / np.outer(stds, stds)
    true, expected = np.array(lines).T, np.array(left).T
    found = np.eye(len(places)) + floor  # its covariance; the robot's own is one
    cross = true @ expected.T - expected @ found @ expected.T
    size = np.sqrt(np.diag(true @ true.T))
    assert np.abs(cross / np.outer(size, size)).max() < 1e-4
    error = true @ true.T - expected @ found @ expected.T
    assert np.trace(error) < 0.9 * np.trace(true @ true.T)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.2))
def test_nothing_is_left_out_twice_over(problem: Problem, seed: int, wander: float) -> None:
    """What is kept of a line is no larger than the line, in the robot's own standard deviations."""
    point = Point(np.random.default_rng(seed).standard_normal(len(problem.base)))
    before, after = point.base, without_floor_friction(problem, point, wander).base
    changed = np.flatnonzero(before != after)
    assert (after[changed] ** 2).sum() <= (before[changed] ** 2).sum() + 1e-9


def test_a_recording_without_wheels_keeps_what_no_mean_explains(problem: Problem) -> None:
    names = tuple("gyro" if each != "battery" else each for each in problem.features.roles)
    blind = replace(problem, features=replace(problem.features, roles=names))
    point = Point(np.ones(len(problem.base)))
    left = without_floor_friction(blind, point, 0.05).base
    for index, each in enumerate(problem.base):
        if each.settings[0][0] == VISCOUS:
            assert left[index] == pytest.approx(1.0)
        if each.settings[0][0] == COULOMB:
            assert 0.0 < left[index] < 1.0


def _lines(base: np.ndarray, places: dict[tuple[str, str | None], int]) -> list[float]:
    """Level and slope at either wheel, in deviations of robot.toml."""
    return [
        float(base[places[(id_, None)]] + WHEEL_STD_SHARE * base[places[(id_, side)]])
        for side in ("left", "right")
        for id_ in (COULOMB, VISCOUS)
    ]
