"""A battery's reading that is worked out from the command of its own row."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.battery_timing import BATTERY_AFTER_COMMAND_NOTE, without_battery_after_commands
from raccoon.diagnose.drives.log import Log, log_from_columns


def driven(late: int, resistance: float = 0.05) -> Log:
    """Reversals every 0.4 s, of wheels that follow within 0.05 s, and the battery's voltage so many rows
    after the commands that it answers."""
    time = np.arange(0.0, 12.0, 0.01)
    duty = np.where((time // 0.4) % 2 > 0.0, -0.8, 0.8)
    speed, speeds = 0.0, []
    for each in duty:
        speeds.append(speed)
        speed += 0.2 * (6.0 * each - speed)
    sag = 2.0 * resistance * duty * (6.8 * duty - 1.08 * np.array(speeds)) / 1.8
    volts = 6.8 - np.roll(sag, late) + np.random.default_rng(1).normal(scale=0.01, size=len(time))
    columns = {"t": time, "battery.voltage": volts} | {f"motor.{port}.duty": duty for port in (0, 1)}
    return log_from_columns(columns, RobotConfig())


@pytest.mark.parametrize("resistance", [0.05, 0.15])
def test_readings_of_rows_whose_command_they_answer_are_left_out_where_commands_jump(
    resistance: float,
) -> None:
    log = without_battery_after_commands(driven(0, resistance))
    assert log.notes == (BATTERY_AFTER_COMMAND_NOTE,)
    battery = log.channel("battery")
    assert battery is not None
    jumps = np.abs(np.diff(log.duty[:, 0], prepend=log.duty[0, 0])) > 0.0
    np.testing.assert_array_equal(np.isnan(battery.values), jumps)


@pytest.mark.parametrize("late", [1, 2])
def test_readings_before_the_command_of_their_row_are_kept(late: int) -> None:
    log = driven(late)
    assert without_battery_after_commands(log) is log


def test_what_a_battery_without_a_sag_says_is_kept() -> None:
    log = driven(0, 0.0)
    assert without_battery_after_commands(log) is log
