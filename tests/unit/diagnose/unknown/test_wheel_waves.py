"""Torques that go round with a wheel, against closed forms and an independent robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blind.generator import Noise, make
from blind.hidden import Hidden
from first_problem import make_problem
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.fit.linear_model import linearise
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.rollout.simulated_robot import with_inertia
from raccoon.diagnose.select.probe_scores import find_best_probe
from raccoon.diagnose.select.search import _restart_beside_probe
from raccoon.diagnose.select.state import refit_with_final_noise, start_search
from raccoon.diagnose.unknown.probes import USUAL_WAVE_TORQUE, make_probe_function
from raccoon.diagnose.unknown.sensor_probes import Probe
from raccoon.diagnose.unknown.shapes import fit_shapes
from raccoon.diagnose.unknown.wheel_waves import (
    COGGING_ORDERS,
    _delayed,
    _low_pass,
    sines_and_cosines,
    torque_waves,
    wheel_angle,
)

ROBOT = RobotConfig()
QUIET = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_push_that_lasts_is_followed_as_an_exponential_says() -> None:
    lasts = np.full(200, 0.03)
    found = _low_pass(np.ones((1, 200)), lasts, 0.005, 2.0)
    assert found[0] == pytest.approx(2.0 * (1.0 - np.exp(-0.005 * np.arange(200) / 0.03)), abs=0.18)
    assert found[0, 60:] == pytest.approx(2.0, abs=1e-4)
    ramp = _low_pass(np.arange(200.0)[None], lasts, 0.005)
    assert ramp[0, 100:] == pytest.approx(np.arange(100.0, 200.0) - 0.03 / 0.005)


@given(rate=st.floats(1.0, 40.0), lasts=st.floats(0.005, 0.2))
def test_a_wave_is_followed_with_the_gain_and_lag_of_a_first_order(rate: float, lasts: float) -> None:
    time = 0.005 * np.arange(800)
    wave = np.stack([np.cos(rate * time), np.sin(rate * time)])
    found = _low_pass(wave, np.full(800, lasts), 0.005)
    wanted = np.exp(1j * rate * time) / (1.0 + 1j * rate * lasts)
    assert np.abs(found[0] + 1j * found[1] - wanted)[500:].max() < 0.01


def test_what_a_motor_that_coasts_was_given_does_not_jump_where_it_is_driven_again() -> None:
    lasts = np.where(np.arange(100) < 50, 10.0, 0.03)
    found = _low_pass(np.ones((1, 100)), lasts, 0.02, lasts / 0.02)
    assert found[0, 50] < found[0, 49]
    assert found[0, -1] == pytest.approx(0.03 / 0.02)


@given(st.floats(0.0, 5.0))
def test_a_line_that_is_late_is_the_line_before(bins: float) -> None:
    found = _delayed(np.arange(20.0)[None], bins)
    assert found[0, 7:] == pytest.approx(np.arange(7.0, 20.0) - bins)


def test_waves_are_multiples_of_the_angle_sines_before_cosines() -> None:
    angle = np.linspace(0.0, 7.0, 30)
    found = sines_and_cosines(angle, 3)
    assert found[1] == pytest.approx(np.sin(2.0 * angle))
    assert found[5] == pytest.approx(np.cos(3.0 * angle))


@pytest.mark.parametrize(("wheel", "key"), [(0, "cogging_l"), (1, "cogging_r")])
def test_an_independent_robot_answers_a_motor_that_cogs_as_its_waves_say(wheel: int, key: str) -> None:
    """By the response to a torque that lasts, a third of it and two fifths of the size are seen."""
    sizes = {"ke_l": 1.08, "ke_r": 1.08, "bemf_offset_l": 0.0, "bemf_offset_r": 0.0}
    (real, without), (_, cogs) = (
        _quiet(Hidden("unknown", None, {}, {**sizes, key: size})) for size in (0.0, 0.02)
    )
    linear = linearise(real, real.nominal(), ["friction.coulomb@left", "friction.coulomb@right"])
    name = f"unknown: wheel angle {('left', 'right')[wheel]}"
    probe = next(each for each in make_probe_function(real)(linear) if each.name == name)
    assert isinstance(probe, Probe)
    five = probe.columns[[4, 4 + COGGING_ORDERS]] / USUAL_WAVE_TORQUE
    changed = cogs - without
    for role in (("bemf_left", "bemf_right")[wheel], "gyro"):
        place = real.features.roles.index(role)
        size, left, *_ = np.linalg.lstsq(five[:, :, place].T, changed[:, place], rcond=None)
        assert np.hypot(*size) == pytest.approx(0.02, rel=0.25), role
        assert float(left[0]) < 0.25 * float((changed[:, place] ** 2).sum()), role


def test_waves_answer_as_the_robot_that_was_found(problem: Problem) -> None:
    """Beside a named inertia or filter they answered as robot.toml's: with a third less inertia, motors that
    cog were said to do so by up to half too much."""
    found, usual = problem.settings(problem.nominal()), problem.robot.model
    bins = len(problem.features.time)
    angle, speeds = np.linspace(0.0, 20.0, bins), np.full((bins, 2), 5.0)

    def answers(robot: RobotConfig, named: Settings) -> np.ndarray:
        its = replace(problem, robot=robot)
        return torque_waves(
            its, found | named, wheel_angle(its, found | named, angle, 0), speeds, 0, False
        ).columns

    factor, slow = 0.65, replace(usual.bemf.filter_time_constant, value=0.0475)
    named = answers(problem.robot, {("drive.inertia", None, "factor"): factor})
    np.testing.assert_allclose(named, answers(with_inertia(problem.robot, factor, factor), {}))
    lag: Settings = {("bemf.filter_lag", side, "time_constant"): slow.value for side in ("left", "right")}
    other = replace(problem.robot, model=replace(usual, bemf=replace(usual.bemf, filter_time_constant=slow)))
    late = answers(problem.robot, lag)
    np.testing.assert_allclose(late, answers(other, lag))
    assert np.ptp(late - answers(problem.robot, {})) > 1.0


def _quiet(hidden: Hidden) -> tuple[Problem, np.ndarray]:
    """The problem of a robot that nothing disturbs, and its readings by bins."""
    log = log_from_columns(make(3, [hidden], seconds=20.0, noise=QUIET).columns, ROBOT)
    real = make_problem(log, ROBOT, drive_causes())
    return real, real.features.measured


def test_how_much_a_motor_cogs_is_said_with_its_size() -> None:
    size = 0.06
    columns = make(21, [Hidden("unknown", None, {}, {"cogging_r": size})], seconds=12.0).columns
    real = make_problem(log_from_columns(columns, ROBOT), ROBOT, drive_causes())
    start = start_search(real, make_probe_function(real))
    (shape,) = fit_shapes(refit_with_final_noise(_restart_beside_probe(start, find_best_probe(start))))
    assert shape.depends_on == "wheel angle right"
    found = shape.size
    assert found.value == pytest.approx(2.0 * size, rel=0.2)
    assert abs(found.value - 2.0 * size) < 3.0 * found.std
