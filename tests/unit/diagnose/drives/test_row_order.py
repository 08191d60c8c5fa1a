"""Recordings whose rows are turned round, or which are two drives one after the other."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.drives.row_order import check_row_order

ROBOT = RobotConfig()
Columns = dict[str, np.ndarray]


def driven(seed: int, seconds: float = 12.0, drive: str = "exciting") -> Columns:
    columns = dict(make(seed, drive=drive, seconds=seconds).columns)
    return {name: each for name, each in columns.items() if not name.startswith("truth.")}


def on_one_clock(columns: Columns) -> Columns:
    return {**columns, "t": 0.005 * np.arange(len(columns["t"]))}


def appended(first: Columns, second: Columns) -> Columns:
    return on_one_clock({name: np.concatenate([first[name], second[name]]) for name in first})


@pytest.mark.parametrize("drive", ["exciting", "contest", "legs"])
def test_a_drive_from_its_beginning_to_its_end_passes(drive: str) -> None:
    check_row_order(log_from_columns(driven(1, drive=drive), ROBOT))


@pytest.mark.parametrize("drive", ["exciting", "contest", "legs"])
def test_rows_in_the_opposite_order_are_an_error_that_says_so(drive: str) -> None:
    back = {name: each[::-1].copy() for name, each in driven(2, drive=drive).items()}
    with pytest.raises(
        TraceError, match=r"motor\.0\.bemf and motor\.1\.bemf change before .* opposite order"
    ):
        diagnose(on_one_clock(back), ROBOT)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_two_drives_in_one_recording_are_an_error_that_names_the_row(seed: int) -> None:
    first, second = driven(seed), driven(seed + 10)
    moving = np.flatnonzero((np.abs(first["motor.0.bemf"]) > 600.0) & (np.abs(first["motor.1.bemf"]) > 600.0))
    row = int(moving[len(moving) // 2])
    both = appended({name: each[:row] for name, each in first.items()}, second)
    with pytest.raises(TraceError, match=rf"at row {row} .*two recordings seem to be put together"):
        diagnose(both, ROBOT)


def test_a_spike_and_a_lost_row_are_no_second_drive() -> None:
    columns = driven(6)
    columns["motor.0.bemf"][700] += 800.0
    lost = {name: np.delete(each, slice(1000, 1010)) for name, each in columns.items()}
    check_row_order(log_from_columns(lost, ROBOT))


def test_readings_that_are_held_for_several_rows_do_not_jump() -> None:
    columns = driven(7)
    held = np.arange(len(columns["t"])) // 4 * 4
    for name in ("motor.0.bemf", "motor.1.bemf"):
        columns[name] = columns[name][held]
    check_row_order(log_from_columns(columns, ROBOT))


def test_a_wheel_too_fast_to_be_read_may_be_anywhere_after_it() -> None:
    columns = driven(8)
    columns["motor.0.bemf"][600:640] = np.nan
    columns["motor.0.bemf"][640:660], columns["motor.0.bemf"][580:600] = -400.0, 1500.0
    check_row_order(log_from_columns(columns, ROBOT))


def test_wheels_that_are_turned_round_stand_still_between_two_steps() -> None:
    """Readings of a reversal behind the emulated stock firmware, one row lost, the next not new yet: 3.5
    counts, then 215, more than 0.08 of the largest reading, at both wheels."""
    reversal = np.array([
        717.5, 716.5, 661.5, 565.5, 446.5, 208.5, 103.5, np.nan,
        -88.5, -85.0, -300.5, -354.5, -404.5, -447.5,
    ])  # fmt: skip
    columns, rng = driven(9), np.random.default_rng(9)
    after = np.arange(len(columns["t"]) - 700 - len(reversal))
    course = np.concatenate([np.full(700, 716.5), reversal, 203.0 * np.exp(-0.1 * after) - 650.0])
    course += rng.integers(-2, 3, len(course))
    columns["motor.0.bemf"], columns["motor.1.bemf"] = course, -course
    check_row_order(log_from_columns(columns, ROBOT))
