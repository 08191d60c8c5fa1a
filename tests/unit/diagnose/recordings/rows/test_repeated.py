"""Rows that say nothing new."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from blind.generator import make
from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.kind import Kind
from raccoon.diagnose.recordings.rows.repeated import (
    without_duplicate_times,
    without_empty_rows,
    without_held_rows,
)
from raccoon.diagnose.recordings.rows.selection import select_rows

Columns = dict[str, np.ndarray]


def filled(columns: Columns) -> Columns:
    """Each sensor's last number where it has none: what a logger of its own holds."""
    found = {}
    for name, each in columns.items():
        rows = np.maximum.accumulate(np.where(np.isfinite(each), np.arange(len(each)), 0))
        found[name] = each[rows]
    return found


def often(columns: Columns, times: int) -> Columns:
    """Each row so many times, at times between."""
    time = np.append(columns["t"], 2.0 * columns["t"][-1] - columns["t"][-2])
    between = np.concatenate(
        [start + (end - start) * np.arange(times) / times for start, end in pairwise(time.tolist())]
    )
    return {name: np.repeat(each, times) for name, each in columns.items()} | {"t": between}


@pytest.mark.parametrize("times", [2, 3])
def test_rows_of_a_logger_that_is_faster_than_what_it_reads_are_left_out(times: int) -> None:
    columns = filled(dict(make(4, seconds=6.0).columns))
    kept, said = without_held_rows(often(columns, times))
    assert len(said) == 1
    assert "rows repeat the row before" in said[0]
    assert len(kept["t"]) == pytest.approx(len(columns["t"]), rel=0.02)
    rows = np.searchsorted(kept["t"], columns["t"], side="right") - 1
    np.testing.assert_array_equal(kept["motor.0.bemf"][rows], columns["motor.0.bemf"])


@pytest.mark.parametrize("encoders", [False, True])
def test_rows_of_a_drive_are_all_kept(encoders: bool) -> None:
    for drive in ("exciting", "contest"):
        columns = dict(make(4, drive=drive, seconds=6.0, encoders=encoders).columns)
        for each in (columns, filled(columns)):
            assert without_held_rows(each) == (each, ())
    assert without_held_rows({}) == ({}, ())


def test_readings_that_never_change_are_left_to_be_told_by_what_they_are() -> None:
    """All but the first row were left out, and a drive of 10 s was said to have 1 sample."""
    still = {"motor.0.duty": 0.5, "motor.1.duty": 0.5, "motor.0.bemf": 400.0, "motor.1.bemf": 400.0}
    columns = {"t": 0.005 * np.arange(2000)} | {name: np.full(2000, value) for name, value in still.items()}
    assert without_held_rows(columns) == (columns, ())


def test_rows_that_a_recorder_wrote_twice_are_left_out_however_many_they_are() -> None:
    """Two recorders into one file: the time was said to be rounded to 5 ms."""
    columns = dict(make(4, seconds=6.0).columns)
    kept, said = without_duplicate_times({name: np.repeat(each, 2) for name, each in columns.items()})
    assert len(said) == 1
    for name, each in columns.items():
        np.testing.assert_array_equal(kept[name], each)
    rounded = {**columns, "t": np.floor(100.0 * columns["t"]) / 100.0}
    assert without_duplicate_times(rounded) == (rounded, ())


def test_repeated_rows_of_columns_that_are_too_short_are_an_error() -> None:
    with pytest.raises(TraceError, match=r"column analog\.0 has shape"):
        without_duplicate_times({"t": np.zeros(9), "analog.0": np.zeros(3)})


def test_readings_in_few_steps_of_a_robot_that_drives_evenly_are_no_faster_logger() -> None:
    """A third of the rows were as those before, none was left out, and "0 of 1200 rows" was said."""
    read = np.random.default_rng(1).choice([400.0, 401.0, 402.0], 1200)
    columns = {"t": 0.005 * np.arange(1200), "motor.0.bemf": read}
    columns |= {"motor.0.duty": np.full(1200, 0.5), "motor.1.bemf": np.full(1200, 400.0)}
    assert without_held_rows(columns) == (columns, ())


def test_rows_that_hold_only_a_time_are_as_lost() -> None:
    columns = dict(make(4, seconds=6.0).columns)
    blank = (columns["t"] > 3.0) & (columns["t"] < 4.0)
    given = {name: each if name == "t" else np.where(blank, np.nan, each) for name, each in columns.items()}
    rows, _ = select_rows(given, Kind.DRIVE)
    assert not ((rows["t"] > 3.0) & (rows["t"] < 4.0)).any()
    for name, each in rows.items():
        np.testing.assert_array_equal(each, columns[name][~blank])
    nothing = {"t": np.arange(3.0), "motor.0.duty": np.full(3, np.nan)}
    assert without_empty_rows(nothing) is nothing
    assert without_empty_rows(columns) is columns
