"""Drives with voltage commands: their conversion to the duties of a motor driver."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import BatteryModel, Measured, RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.commands import hold_until_next
from raccoon.diagnose.drives.holdout import check_none_missing, naming_holdout
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

BATTERY_HIDDEN = (
    "not identifiable: motor.N.voltage is recorded instead of motor.N.duty, so the driver hides the battery"
)
MAX_COMMAND_V = 30.0
"""Largest voltage command of a motor, V."""
MIN_READINGS = 20
"""Least number of battery readings."""
BY_READING_NOTE = (
    "motor.N.voltage is recorded instead of motor.N.duty: converted to the duties that a driver makes of it "
    "with the last reading of battery.voltage"
)
CLEARLY_SMALLER_ERROR = 0.85
"""Ratio of the errors of two diagnoses below which the first explains a drive better: 0.4 to 0.5 if a driver
holds its voltage whatever the battery does, 1.09 at most if both explain the drive."""
COMPLETE_VERDICTS = (Verdict.ADEQUATE, Verdict.EXPLAINED)
MAX_VOLTS_RATIO, MAX_EXCEEDING_SHARE = 1.05, 0.02
"""Voltage over the battery's reading that no driver can exceed, and share of rows that may exceed it by
error."""


def has_volt_commands(columns: Columns, robot: RobotConfig) -> bool:
    """Whether both wheels' commands are voltages."""
    names = [f"motor.{port}." for port in (robot.drive.left, robot.drive.right)]
    return all(f"{each}voltage" in columns and f"{each}duty" not in columns for each in names)


def duties_by_battery_reading(columns: Columns, robot: RobotConfig) -> Columns | None:
    """The columns with voltage commands converted to duties by the last battery reading, as a driver computes
    them; if the battery's voltage drops faster than it is read, the motor gets less. None if the battery was
    not read, or reads too low to supply these voltages."""
    reading = np.asarray(columns.get("battery.voltage", ()), float)
    known = reading[reading > 0.0]
    if len(known) < MIN_READINGS:
        return None
    last_reading = hold_until_next(np.where(reading > 0.0, reading, np.nan))
    voltage = np.where(last_reading > 0.0, last_reading, known[0])
    volts = _commanded_volts(columns, robot)
    if any(
        (np.abs(each) > MAX_VOLTS_RATIO * voltage).mean() > MAX_EXCEEDING_SHARE for each in volts.values()
    ):
        return None
    names = {f"motor.{port}.voltage" for port in volts}
    others = {name: each for name, each in columns.items() if name not in names}
    return others | {f"motor.{port}.duty": np.clip(each / voltage, -1.0, 1.0) for port, each in volts.items()}


def duties_of_stiff_battery(
    columns: Columns, robot: RobotConfig, holdout: Columns | None = None
) -> tuple[dict[str, Array], RobotConfig, tuple[Cause, ...]]:
    """Columns and robot in which the voltages are duties of a stiff battery, and the remaining causes.

    A driver that holds its voltage gives the same with any battery, so the battery's resistance and charge
    have no effect. holdout: another recording whose voltages the battery must supply as well. Raises
    TraceError for voltages that no robot has.
    """
    volts = _commanded_volts(columns, robot)
    largest = _largest_volts(volts)
    if holdout is not None:
        with naming_holdout():
            largest = max(largest, _largest_volts(_commanded_volts(holdout, robot)))
    supply = max(largest, robot.model.battery.open_circuit_voltage.value)
    others = {name: each for name, each in columns.items() if name != "battery.voltage"}
    others |= {f"motor.{port}.duty": each / supply for port, each in volts.items()}
    battery = BatteryModel(Measured(supply), Measured(0.0))
    causes = tuple(each for each in drive_causes() if not each.id.startswith("battery."))
    return others, replace(robot, model=replace(robot.model, battery=battery)), causes


def _commanded_volts(columns: Columns, robot: RobotConfig) -> dict[int, Array]:
    names = {port: f"motor.{port}.voltage" for port in (robot.drive.left, robot.drive.right)}
    check_none_missing([name for name in names.values() if name not in columns])
    return {port: np.asarray(columns[name], float) for port, name in names.items()}


def _largest_volts(volts: Mapping[int, Array]) -> float:
    largest = max(float(np.nanmax(np.abs(each), initial=0.0)) for each in volts.values())
    if largest > MAX_COMMAND_V:
        raise TraceError(
            f"motor.N.voltage reaches {largest:g} V: allowed are {MAX_COMMAND_V:g} V either way; it looks "
            "like millivolts or counts"
        )
    return largest


def with_battery_rejected(found: Diagnosis) -> Diagnosis:
    """The diagnosis of a drive in volts, with the battery's causes rejected, since the driver hides them."""
    ids = ("battery.open_circuit_voltage", "battery.internal_resistance", "battery.discharge")
    return replace(
        found, rejected=(*found.rejected, *(Rejected(each, BATTERY_HIDDEN) for each in ids)), model=None
    )


def explains_better(one: Diagnosis, other: Diagnosis) -> bool:
    """Whether the first diagnosis clearly leaves less error in the channels that both simulate; or, if the
    errors are similar, has a complete verdict while the other has not, or as complete a one with fewer causes
    (not counting the other's battery causes)."""
    other_errors = {each.name: each.rmse_after for each in other.channels}
    log_ratios = [
        math.log(each.rmse_after / other_errors[each.name])
        for each in one.channels
        if other_errors.get(each.name)
    ]
    ratio = math.exp(sum(log_ratios) / len(log_ratios)) if log_ratios else math.inf
    if ratio < CLEARLY_SMALLER_ERROR or ratio > 1.0 / CLEARLY_SMALLER_ERROR:
        return ratio < CLEARLY_SMALLER_ERROR
    other_causes = [each for each in other.causes if not each.id.startswith("battery.")]
    is_complete, other_is_complete = one.verdict in COMPLETE_VERDICTS, other.verdict in COMPLETE_VERDICTS
    return is_complete > other_is_complete or (
        is_complete == other_is_complete and len(one.causes) < len(other_causes)
    )
