from __future__ import annotations

import csv

import numpy as np
import pytest

from raccoon.diagnose.recordings.motors.reading_faults import reading_faults
from shared_data import data_path


def read(name: str) -> tuple[np.ndarray, np.ndarray]:
    with (data_path("wombat-motor-steps") / name).open() as file:
        rows = list(csv.DictReader(file))
    return (
        np.array([float(row["time_s"]) for row in rows]),
        np.array([float(row["velocity_rad_s"]) for row in rows]),
    )


@pytest.mark.parametrize("motor", range(4))
def test_a_real_wombats_dead_time_at_10_percent(motor: int) -> None:
    faults = reading_faults(*read(f"motor_{motor}_cmd_10.csv"))
    assert faults.dead_time == pytest.approx(0.255, abs=0.015)
    assert faults.repeats > 0.04


@pytest.mark.parametrize("name", ["motor_0_cmd_15.csv", "motor_1_cmd_15.csv", "motor_2_cmd_20.csv"])
def test_a_real_wombats_stale_start_decays_by_a_fifth_a_sample(name: str) -> None:
    faults = reading_faults(*read(name))
    assert faults.stale is not None
    assert abs(faults.stale) > 80.0
    assert faults.decay == pytest.approx(0.2, abs=0.02)


def test_a_made_step() -> None:
    time = 0.01 * np.arange(200, dtype=np.float64)
    speed = np.where(time >= 0.3, 5.0, 0.0) + np.where(
        np.arange(200) < 6, -400.0 * 0.2 ** np.arange(200.0), 0.0
    )
    faults = reading_faults(time, speed)
    assert faults.stale == pytest.approx(-400.0)
    assert faults.decay == pytest.approx(0.2)
    assert faults.dead_time == pytest.approx(0.3)


def test_a_reading_without_motion_has_no_dead_time() -> None:
    faults = reading_faults(0.01 * np.arange(100, dtype=np.float64), np.zeros(100))
    assert faults.dead_time is None
    assert faults.stale is None
    assert faults.repeats == 1.0
