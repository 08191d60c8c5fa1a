"""Numbers that stand for nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.generator import make
from blind.hidden import draw
from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.channels.faulty import without_faulty_channels
from raccoon.diagnose.recordings.channels.invalid_samples import command_behind

ROBOT = RobotConfig()
Columns = dict[str, np.ndarray]
BATTERY, GYRO, LEFT = "battery.voltage", "imu.gyro.z", "motor.0.bemf"


@pytest.fixture(scope="module")
def good() -> Columns:
    return dict(make(4, seconds=12.0).columns)


def faults(columns: Columns) -> list[tuple[str, str]]:
    return [(each.channel, each.fault) for each in without_faulty_channels(columns, ROBOT).faults]


@pytest.mark.parametrize("encoders", [False, True])
@pytest.mark.parametrize("cause", ["friction.stiction", "bemf.dead_zone", "drive.backlash"])
def test_a_sound_reading_has_none(cause: str, encoders: bool) -> None:
    for drive in ("exciting", "contest"):
        hidden = draw(cause, np.random.default_rng(3), 2.0)
        made = make(5, [hidden], drive=drive, seconds=12.0, encoders=encoders).columns
        columns = {name: each[:-1] for name, each in made.items()}  # the last of its encoders is none
        sound = without_faulty_channels(columns, ROBOT)
        assert sound.faults == ()
        for name, each in columns.items():
            np.testing.assert_array_equal(sound.columns[name], each)


@pytest.mark.parametrize("filler", [0.0, -1.0, -999.0])
def test_a_battery_of_no_voltage_was_not_read(good: Columns, filler: float) -> None:
    """With 0 for what was not read it was one of 3.39 V, with a probability of 1."""
    filled = {**good, BATTERY: np.where(np.isnan(good[BATTERY]), filler, good[BATTERY])}
    sound = without_faulty_channels(filled, ROBOT)
    np.testing.assert_array_equal(sound.columns[BATTERY], good[BATTERY])
    assert f"is {filler:g} V in 50" in sound.faults[0].text


@pytest.mark.parametrize("name", [GYRO, LEFT])
def test_zeros_between_readings_are_none(good: Columns, name: str) -> None:
    blank = np.isnan(good[name]) | (np.arange(len(good["t"])) % 3 == 0)
    sound = without_faulty_channels({**good, name: np.where(blank, 0.0, good[name])}, ROBOT)
    kept = sound.columns[name]
    assert np.isnan(kept[blank]).all()
    assert np.isfinite(kept[~blank]).mean() > 0.9
    assert "far from the values beside it" in sound.faults[0].text


def test_spikes_are_left_out(good: Columns) -> None:
    last = len(good["t"]) - 1
    spiky, rows = good[LEFT].copy(), np.array([0, 300, 800, 801, 1500, last])
    spiky[rows] = [9000.0, 30000.0, -9000.0, -9100.0, 12000.0, -30000.0]
    sound = without_faulty_channels({**good, LEFT: spiky}, ROBOT)
    assert np.flatnonzero(np.isnan(sound.columns[LEFT])).tolist() == rows.tolist()
    assert [(each.channel, each.fault) for each in sound.faults] == [(LEFT, "impossible")]


@pytest.mark.parametrize("name", [GYRO, LEFT])
def test_a_reading_that_stays_while_commands_change_is_left_out_there(good: Columns, name: str) -> None:
    """A gyro that froze for four seconds was a slip of 8 ms."""
    known = np.flatnonzero(np.isfinite(good[name]))
    start = next(row for row in known if row > 900 and abs(good[name][row]) > 0.6 * np.nanmax(good[name]))
    frozen = good[name].copy()
    frozen[start : start + 500] = frozen[start]
    sound = without_faulty_channels({**good, name: frozen}, ROBOT)
    assert np.isnan(sound.columns[name][start : start + 500]).all()
    assert [(each.channel, each.fault) for each in sound.faults] == [(name, "frozen")]
    assert "although the commands change" in sound.faults[0].text


def test_a_gyro_in_whole_numbers_is_left_out_and_a_coarse_wheel_is_not_cut_off(good: Columns) -> None:
    sound = without_faulty_channels({**good, GYRO: np.asarray(np.round(good[GYRO]), float)}, ROBOT)
    assert GYRO not in sound.columns
    assert sound.left_out == {GYRO: "it is rounded too coarsely"}
    steps = 100.0 * np.round(good[LEFT] / 100.0)
    assert faults({**good, LEFT: steps}) == []


def test_a_gyro_that_a_logger_holds_is_known_where_it_is_new(good: Columns) -> None:
    """One of 50 Hz in rows of 200 Hz was wheels that slip by 8 ms."""
    rows = np.maximum.accumulate(np.where(np.isfinite(good[GYRO]), np.arange(len(good["t"])), 0))
    sound = without_faulty_channels({**good, GYRO: good[GYRO][rows]}, ROBOT)
    kept, fresh = np.isfinite(sound.columns[GYRO]), np.isfinite(good[GYRO])
    assert sound.faults == ()
    assert not kept[~fresh].any()
    assert kept[fresh].mean() > 0.9


def test_what_moves_a_reading_is_its_own_command(good: Columns) -> None:
    left, right = good["motor.0.duty"].copy(), good["motor.1.duty"]
    np.testing.assert_array_equal(command_behind("gyro", good, ROBOT), 0.5 * (right - left))
    motors = {0: replace(ROBOT.motor(0), inverted=True), 1: ROBOT.motor(1)}
    wired = {**good, "motor.0.duty": -left}  # what turns a robot is no matter of how its motors are wired
    np.testing.assert_array_equal(
        command_behind("gyro", wired, replace(ROBOT, motors=motors)), 0.5 * (right - left)
    )
    left[:3] = left[100] = np.nan
    own = command_behind("bemf_left", {**good, "motor.0.duty": left}, ROBOT)
    assert own is not None
    assert own[:3].tolist() == [0.0, 0.0, 0.0]
    assert own[100] == left[99]
    assert command_behind("bemf_left", {"t": good["t"]}, ROBOT) is None
    assert command_behind("gyro", {"t": good["t"]}, ROBOT) is None
