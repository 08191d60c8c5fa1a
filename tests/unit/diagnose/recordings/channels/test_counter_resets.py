"""Counters of wheels that begin anew."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from raccoon.core.config import RobotConfig
from raccoon.core.readings import SI_WORDS
from raccoon.diagnose.recordings.channels.counters import counter_reset_notes, with_counter_bemf

ROBOT = RobotConfig()
COUNTERS = ("motor.0.position", "motor.1.position")
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def good() -> Columns:
    return dict(make(4, seconds=8.0).columns)


def cleared(columns: Columns, rows: list[int], names: tuple[str, ...] = COUNTERS) -> Columns:
    """As if a program had set these counters to 0 in these rows."""
    found = dict(columns)
    for name in names:
        values = columns[name].copy()
        for row in rows:
            values[row:] -= values[row] + 5000.0
        found[name] = values
    return found


def test_counters_that_jump_once_may_be_two_recordings(good: Columns) -> None:
    (said,) = counter_reset_notes(cleared(good, [700]), ROBOT)
    assert f"motor.0.position and motor.1.position restart at {good['t'][700]:.1f} s, row 700" in said


def test_a_drive_and_a_program_that_clears_its_counters_for_each_motion_are_one(good: Columns) -> None:
    for columns in (good, cleared(good, [300, 700, 1100]), cleared(good, [700], COUNTERS[:1])):
        assert counter_reset_notes(columns, ROBOT) == ()
    assert counter_reset_notes({"t": good["t"]}, ROBOT) == ()


def test_a_counter_over_a_time_that_stands_still_is_no_warning(good: Columns) -> None:
    """Of another recording than the first its time is looked at later, and refused."""
    time = np.where(np.arange(len(good["t"])) % 40 < 20, good["t"], good["t"][0])
    columns = {"t": time, **{name: good[name] for name in COUNTERS}}
    made = with_counter_bemf(columns, ROBOT, SI_WORDS).columns
    assert not np.isinf(made["motor.0.bemf"]).any()
