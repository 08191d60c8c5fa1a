"""Wheels that stand although they are driven: when, which, and what the battery's voltage tells of it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.generator import make
from blind.hidden import CAUSES, UNKNOWN, Hidden, draw, draw_unknown
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.drives.stalls import find_stalls, leave_out_stalls
from raccoon.diagnose.drives.units import describe_wrong_units
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import Verdict

Array = NDArray[np.float64]
ROBOT = RobotConfig()
FULL = ROBOT.model.battery.open_circuit_voltage.value
SPAN = (6.0, 9.0)


def drive(stand: tuple[int, ...], current: bool, span: tuple[float, float] = SPAN) -> dict[str, Array]:
    """A robot that turns and drives by turns for 12 s; wheels that stand within the span, with or without the
    current of a motor that does so."""
    time = np.arange(0.0, 12.0, 0.005)
    rng = np.random.default_rng(5)
    columns, taken = {"t": time}, np.zeros(len(time))
    for port, way in ((0, 1.0), (1, -1.0)):
        duty = 0.55 + 0.15 * way * np.sign(np.sin(1.7 * time))
        stands = (time >= span[0]) & (time < span[1]) & (port in stand)
        volts = np.where(stands, 0.0, 0.9 * FULL * duty)
        draws = np.where(stands & (not current), 0.0, duty * (FULL * duty - volts) / 1.8)
        taken += draws
        columns[f"motor.{port}.duty"] = duty
        columns[f"motor.{port}.bemf"] = volts / BEMF_VOLTS_PER_COUNT + rng.standard_normal(len(time))
    resistance = ROBOT.model.battery.internal_resistance.value
    columns["battery.voltage"] = FULL - resistance * taken + 0.01 * rng.standard_normal(len(time))
    return columns


def log(columns: dict[str, Array]) -> Log:
    return log_from_columns(columns, ROBOT)


@pytest.mark.parametrize(
    ("stand", "current", "said"),
    [
        ((0,), False, r"motor 0 \(left\) did not turn .* no current of it: unplugged, or its fuse tripped"),
        ((1,), True, r"motor 1 \(right\) did not turn .* shows its current: jammed"),
        ((0, 1), False, r"neither wheel turned .* no current: both motors were switched off"),
        ((0, 1), True, r"neither wheel turned .* shows their current: held"),
    ],
)
def test_what_stands_is_said_with_its_times_and_left_out(
    stand: tuple[int, ...], current: bool, said: str
) -> None:
    seen = leave_out_stalls(log(drive(stand, current)), ROBOT)
    ((column, text),) = seen.stalls
    assert column == f"motor.{stand[0]}.duty"
    assert text.startswith("from 6.0 to 9.0 s ")
    assert re.search(said, text), text
    ((start, end),) = seen.held
    assert (start, end) == pytest.approx(SPAN, abs=0.05)
    assert seen.lost[0][0] == start


def test_wheels_that_stood_for_long_are_no_other_unit() -> None:
    """As where a program that steers all the time ended, and its log went on with the last command."""
    columns = drive((0, 1), current=False, span=(5.5, 12.0))
    time = columns["t"]
    way = np.where(time < 2.7, np.sign(np.sin(2.0 * np.pi * time)), 1.0)
    for port in (0, 1):
        steers = np.where((time > 2.7) & (time < 5.5), 0.01 * np.sin(90.0 * time), 0.0)
        columns[f"motor.{port}.duty"] = way * 0.6 + steers
        columns[f"motor.{port}.bemf"] *= way
    assert describe_wrong_units(columns, ROBOT) == ""


def test_without_a_battery_it_may_be_either() -> None:
    columns = drive((0,), current=False)
    del columns["battery.voltage"]
    ((_, text),) = leave_out_stalls(log(columns), ROBOT).stalls
    assert "unplugged, its fuse tripped, or jammed" in text


def test_what_is_left_out_already_is_not_left_out_twice() -> None:
    whole = replace(log(drive((0, 1), current=False)), held=((5.9, 9.1),), lost=((5.9, 9.4),))
    seen = leave_out_stalls(whole, ROBOT)
    assert (seen.held, seen.lost) == (whole.held, whole.lost)
    assert "switched off" in seen.stalls[0][1]


def test_too_little_that_turned_is_an_error_that_says_why() -> None:
    with pytest.raises(TraceError, match=r"from 0.5 to 12.0 s motor 0 \(left\).*needs at least 2 s"):
        leave_out_stalls(log(drive((0,), False, (0.5, 12.0))), ROBOT)


def faults() -> list[Hidden]:
    rng = np.random.default_rng(3)
    return [*(draw(each, rng, 1.5) for each in CAUSES), *(draw_unknown(each, rng) for each in UNKNOWN)]


def test_no_fault_of_a_robot_makes_a_wheel_stand() -> None:
    for number, each in enumerate(faults()):
        kind = ("exciting", "contest")[number % 2]
        seen = log(dict(make(number, [each], drive=kind, seconds=15.0).columns))
        assert find_stalls(seen, ROBOT) == (), each
        assert leave_out_stalls(seen, ROBOT) is seen


@pytest.mark.usefixtures("few_causes", "known_controller")
def test_a_plug_that_falls_out_is_what_is_said_first_of_a_sound_robot() -> None:
    """It was "a way that no known cause describes", and nothing said when."""
    rng = np.random.default_rng(8)
    levels = np.repeat(rng.uniform(-0.9, 0.9, (40, 2)), 100, axis=0)
    levels[2800:] = np.tile([[0.5, 0.4], [-0.4, 0.5]], (6, 1)).repeat(100, axis=0)
    unplugged = levels.copy()
    unplugged[2800:, 0] = 0.0
    columns = dict(make(6, drive=unplugged).columns)
    out = columns["t"] > 13.99
    columns["motor.0.duty"] = np.where(out, 0.45 * np.sign(columns["motor.1.duty"]), columns["motor.0.duty"])
    found = diagnose_recording(columns, ROBOT)
    (fault,) = found.sensor_faults
    assert fault.text.startswith("from 14.0 to 20.0 s motor 0 (left) did not turn although it was driven")
    assert (found.verdict, found.causes) == (Verdict.ADEQUATE, ())
    first, second, *_ = terminal_report(found).splitlines()
    assert "nothing that matters is wrong" not in first
    assert second.startswith("  ! Motor: from 14.0 to 20.0 s motor 0")
