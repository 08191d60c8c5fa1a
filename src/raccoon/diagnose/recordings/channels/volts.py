"""Drives whose commands are volts: which duties a driver makes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import BatteryModel, Measured, RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.commands import until_next
from raccoon.diagnose.drives.unseen import check_has, said_of_holdout
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

VOLTS = (
    "not identifiable: motor.N.voltage is recorded instead of motor.N.duty, so the driver hides the battery"
)
MOST_VOLTS = 30.0
"""V that a motor is given at most."""
FEWEST = 20
"""Readings of a battery that tell what it has."""
BY_READING = (
    "motor.N.voltage is recorded instead of motor.N.duty: taken for the duties that a driver makes of it by "
    "battery.voltage as it was read last"
)
BETTER = 0.85
"""Times the error of another, by which a diagnosis explains a drive better than it: 0.4 to 0.5 where a driver
keeps its volts whatever the battery does, 1.09 at most where both explain the drive."""
WHOLE = (Verdict.ADEQUATE, Verdict.EXPLAINED)
BEYOND, RARELY = 1.05, 0.02
"""Times what was read of a battery that no driver makes of it, and a share of rows that may be mistaken."""


def commands_volts(columns: Columns, robot: RobotConfig) -> bool:
    """Whether both wheels' commands are volts."""
    names = [f"motor.{port}." for port in (robot.drive.left, robot.drive.right)]
    return all(f"{each}voltage" in columns and f"{each}duty" not in columns for each in names)


def over_reading(columns: Columns, robot: RobotConfig) -> Columns | None:
    """The columns with commanded volts as duties, by what was read of the battery last: so a driver makes
    volts of it, and a battery that falls faster than it is read gives less. None where it was not read, or
    cannot be the battery that the volts are of.
    """
    reading = np.asarray(columns.get("battery.voltage", ()), float)
    known = reading[reading > 0.0]
    if len(known) < FEWEST:
        return None
    last = until_next(np.where(reading > 0.0, reading, np.nan))
    held = np.where(last > 0.0, last, known[0])
    volts = _volts(columns, robot)
    if any((np.abs(each) > BEYOND * held).mean() > RARELY for each in volts.values()):
        return None
    names = {f"motor.{port}.voltage" for port in volts}
    kept = {name: each for name, each in columns.items() if name not in names}
    return kept | {f"motor.{port}.duty": np.clip(each / held, -1.0, 1.0) for port, each in volts.items()}


def as_duty(
    columns: Columns, robot: RobotConfig, holdout: Columns | None = None
) -> tuple[dict[str, Array], RobotConfig, tuple[Cause, ...]]:
    """Columns and robot in which the volts are duties of a stiff battery, and the causes that remain.

    A driver that commands volts makes the same of any battery, so its resistance and charge do not act.
    holdout: what this battery must have the volts for as well. Raises TraceError for volts that no robot has.
    """
    volts = _volts(columns, robot)
    largest = _largest(volts)
    if holdout is not None:
        with said_of_holdout():
            largest = max(largest, _largest(_volts(holdout, robot)))
    supply = max(largest, robot.model.battery.open_circuit_voltage.value)
    kept = {name: each for name, each in columns.items() if name != "battery.voltage"}
    kept |= {f"motor.{port}.duty": each / supply for port, each in volts.items()}
    battery = BatteryModel(Measured(supply), Measured(0.0))
    causes = tuple(each for each in drive_causes() if not each.id.startswith("battery."))
    return kept, replace(robot, model=replace(robot.model, battery=battery)), causes


def _volts(columns: Columns, robot: RobotConfig) -> dict[int, Array]:
    names = {port: f"motor.{port}.voltage" for port in (robot.drive.left, robot.drive.right)}
    check_has([name for name in names.values() if name not in columns])
    return {port: np.asarray(columns[name], float) for port, name in names.items()}


def _largest(volts: Mapping[int, Array]) -> float:
    largest = max(float(np.nanmax(np.abs(each), initial=0.0)) for each in volts.values())
    if largest > MOST_VOLTS:
        raise TraceError(
            f"motor.N.voltage reaches {largest:g} V: allowed are {MOST_VOLTS:g} V either way; it looks like "
            "millivolts or counts"
        )
    return largest


def without_battery(found: Diagnosis) -> Diagnosis:
    """A diagnosis of a drive in volts, with what that hides."""
    ids = ("battery.open_circuit_voltage", "battery.internal_resistance", "battery.discharge")
    return replace(found, rejected=(*found.rejected, *(Rejected(each, VOLTS) for each in ids)), model=None)


def explains_better(one: Diagnosis, other: Diagnosis) -> bool:
    """Whether one diagnosis leaves less of what both simulate than another does, or about as little and says
    so by fewer causes beside those of the battery, or without a rest.
    """
    left = {each.name: each.rmse_after for each in other.channels}
    shared = [math.log(each.rmse_after / left[each.name]) for each in one.channels if left.get(each.name)]
    share = math.exp(sum(shared) / len(shared)) if shared else math.inf
    if share < BETTER or share > 1.0 / BETTER:
        return share < BETTER
    needed = [each for each in other.causes if not each.id.startswith("battery.")]
    whole, others = one.verdict in WHOLE, other.verdict in WHOLE
    return whole > others or (whole == others and len(one.causes) < len(needed))
