"""Recordings that were brought to another rate."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from raccoon.core.config import RobotConfig
from raccoon.core.errors import HoldoutError, TraceError
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.rows.interpolation import check_not_interpolated

Columns = dict[str, np.ndarray]
ROBOT = RobotConfig()


@pytest.fixture(scope="module")
def good() -> Columns:
    return dict(make(4, seconds=8.0).columns)


def resampled(columns: Columns, row: float, held: bool = False) -> Columns:
    """All columns at even times, on lines between their samples or with the last of these."""
    time = columns["t"]
    even: np.ndarray = np.arange(time[0], time[-1], row)
    found: Columns = {"t": even}
    for name, values in columns.items():
        known = np.flatnonzero(np.isfinite(values))
        last = known[np.clip(np.searchsorted(time[known], even, side="right") - 1, 0, None)]
        found.setdefault(name, values[last] if held else np.interp(even, time[known], values[known]))
    return found


@pytest.mark.parametrize("row", [0.002, 0.001])
def test_straight_lines_between_samples_are_said(good: Columns, row: float) -> None:
    """At 1 ms a sound robot's commands were 6 ms late with a probability of 1."""
    with pytest.raises(TraceError, match=r"motor\.\d\.(duty has|bemf is) .* was interpolated"):
        diagnose_recording(resampled(good, row), ROBOT)
    with pytest.raises(HoldoutError, match="was interpolated to another rate"):
        diagnose_recording(good, ROBOT, holdout=resampled(good, row))


def test_commands_between_two_commands_are_said(good: Columns) -> None:
    """At twice the rate no reading is on a line that three rows have, and late commands were named too."""
    with pytest.raises(TraceError, match=r"motor\.0\.duty has rows with values between two .* interpolated"):
        check_not_interpolated(resampled(good, 0.0025))
    check_not_interpolated(resampled(good, 0.005))


@pytest.mark.parametrize("row", [0.004, 0.0035, 0.0031])
def test_so_they_are_of_a_little_faster_rows(good: Columns, row: float) -> None:
    """Of a sound robot latencies of 1.5 to 2.2 ms were named, each with a probability of 1."""
    with pytest.raises(TraceError, match=r"motor\.0\.duty has rows with values between two .* interpolated"):
        check_not_interpolated(resampled(good, row))


@pytest.mark.parametrize("sizes", [(0.3, 0.5), (0.25, 0.3, 0.45), (0.3, 0.35, 0.4, 0.5)])
def test_a_ramp_of_so_much_a_row_is_none(sizes: tuple[float, ...]) -> None:
    now, ramped = 0.0, []
    for step in range(40):
        for _ in range(10):
            goal = (-1.0) ** step * sizes[step % len(sizes)] / 2.0
            now += max(-0.2, min(0.2, goal - now))
            ramped.append(now)
    columns: Columns = {"t": 0.005 * np.arange(len(ramped)), "motor.0.duty": np.array(ramped)}
    check_not_interpolated(columns)


@pytest.mark.parametrize("most", [0.03, 0.1, 0.25])
@pytest.mark.parametrize("rows", [1, 2, 3, 5])
def test_a_program_that_ramps_its_commands_interpolates_none(good: Columns, most: float, rows: int) -> None:
    columns = dict(good)
    for name in ("motor.0.duty", "motor.1.duty"):
        now, ramped = 0.0, []
        for each in good[name].tolist():
            now += max(-most, min(most, each - now))
            ramped.append(now)
        columns[name] = np.convolve(ramped, np.ones(rows) / rows, "same")
    check_not_interpolated(columns)


@pytest.mark.parametrize("drive", ["exciting", "contest", "legs"])
@pytest.mark.parametrize("encoders", [False, True])
@pytest.mark.parametrize("unit", [1.0, 0.25, 1.0 / 303.4 / 1.08])
def test_what_was_recorded_is_on_none(drive: str, encoders: bool, unit: float) -> None:
    columns = dict(make(4, drive=drive, seconds=8.0, encoders=encoders).columns)
    for name in [each for each in columns if each.endswith((".bemf", ".speed"))]:
        columns[name] = unit * columns[name]
    check_not_interpolated(columns)
    check_not_interpolated(resampled(columns, 0.001, held=True))


@pytest.mark.parametrize("every", [2, 4])
def test_a_programs_ramp_is_none_of_which_some_rows_were_recorded(every: int) -> None:
    """How a row cuts into a ramp is chance, as in what is interpolated."""
    rng, now, ramped = np.random.default_rng(1), 0.0, []
    for step in range(80):
        goal = 0.0 if step % 2 else rng.uniform(0.4, 0.5) * rng.choice([-1.0, 1.0])
        for _ in range(int(rng.integers(80, 120))):
            now += max(-0.1 / every, min(0.1 / every, goal - now))
            ramped.append(now)
    duty = np.array(ramped)[::every]
    columns: Columns = {"t": 0.005 * every * np.arange(len(duty)), "motor.0.duty": duty}
    check_not_interpolated(columns)


def test_a_wheel_that_speeds_up_evenly_without_noise_is_on_no_short_line() -> None:
    way = np.concatenate([np.linspace(0.0, 1234.5, 300), np.linspace(1234.5, 0.0, 300)])
    columns: Columns = {"t": 0.005 * np.arange(600), "motor.0.bemf": way, "motor.1.bemf": way}
    check_not_interpolated(columns)
