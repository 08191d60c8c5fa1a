"""The loaders on the real recordings they were written for."""

import re

import numpy as np
import pytest

from raccoon.trace.foreign.fleet_steps import read_fleet_steps
from raccoon.trace.foreign.motor_steps import read_motor_steps
from raccoon.trace.loading import load_runs
from shared_data import data_path


def test_every_optiodom_run_is_read_with_its_robot() -> None:
    runs = load_runs(data_path("optiodom"))
    assert len(runs) == 102
    for run in runs:
        assert run.robot is not None
        assert 0.083 < 2 * run.robot.model.drive.wheel_radius.value < 0.086
        np.testing.assert_allclose(np.diff(run.recording["t"]), 0.05, atol=1e-6)
        assert np.abs(np.diff(run.recording["truth.heading"])).max() < 0.5


def test_stale_and_repeated_samples_of_the_wombat_are_reported_and_not_used() -> None:
    starts, shares = [], []
    for path in sorted(data_path("wombat-motor-steps").glob("motor_*.csv")):
        recording = read_motor_steps(path)
        said = " ".join(recording.problems)
        if found := re.search(r"decays from (-?[\d.]+) rad/s", said):
            starts.append(float(found.group(1)))
        found = re.search(r"\((\d+) %\) repeat", said)
        assert found is not None
        shares.append(int(found.group(1)))
        [port] = recording.ports("motor", "speed")
        speed = recording[f"motor.{port}.speed"]
        assert np.nanmax(np.abs(speed)) < 6.0  # rad/s; the recorded ones reach 2043
        assert np.isnan(speed).mean() == pytest.approx(shares[-1] / 100, abs=0.011)
    assert len(starts) == 8
    assert (min(starts), max(starts)) == (-2043.0, -85.8)
    assert min(shares) >= 4
    assert max(shares) <= 43


def test_dead_time_of_the_wombat_shows_in_the_speed() -> None:
    """A wheel that still coasts comes to rest, then 0.24 to 0.27 s pass before the step moves it."""
    for path in sorted(data_path("wombat-motor-steps").glob("motor_*.csv")):
        recording = read_motor_steps(path)
        [port] = recording.ports("motor", "speed")
        moving = recording["t"][np.abs(recording[f"motor.{port}.speed"]) > 0.01]
        assert 0.235 < moving[moving > 0.13][0] < 0.27


def test_faults_of_the_fleet_are_reported() -> None:
    problems = {
        path.stem: recording.problems
        for path in sorted(data_path("fleet-steps").glob("*.csv"))
        if (recording := read_fleet_steps(path)).problems
    }
    assert problems == {
        "robot-18": ["motor 1: the current is 0.0 A at most: dead"],
        "robot-78": ["motor 1: -3.3467 m/s is impossible between the values before and after it"],
    }
