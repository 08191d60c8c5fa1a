"""Drives with only part of the channels: what takes their place, and what cannot be known without them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import BatteryModel, Measured, RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.log import ROLES
from raccoon.diagnose.drives.unseen import check_has, said_of_holdout
from raccoon.diagnose.hypotheses.candidates import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

VOLTS = (
    "not identifiable: motor.N.voltage is recorded instead of motor.N.duty, so the driver hides the battery"
)
_NO_READING = re.compile(r"there is no (\w+(?: or \w+)*) reading in this recording")
EVERY_GROUP = ("battery.*", "motor.*", "friction.*", "drive.*", "actuation.*", "bemf.*", "imu.*")
MOST_VOLTS = 30.0
FEWEST = 20
"""Numbers from which a column is a reading."""


def commands_volts(columns: Columns, robot: RobotConfig) -> bool:
    """Whether both wheels' commands are volts."""
    names = [f"motor.{port}." for port in (robot.drive.left, robot.drive.right)]
    return all(f"{each}voltage" in columns and f"{each}duty" not in columns for each in names)


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


def with_columns_named(
    found: Diagnosis, columns: Columns, robot: RobotConfig, left_out: Mapping[str, str] | None = None
) -> Diagnosis:
    """Reasons that speak of a missing reading, with the column's name. left_out: columns that were recorded
    and not used, and why."""
    ports = {"left": robot.drive.left, "right": robot.drive.right}
    names = {role: pattern.format(**ports) for role, (pattern, _, _) in ROLES.items()}
    said = {role: absence(name, left_out or {}) for role, name in names.items()}
    rejected = [_named(each, said) for each in found.rejected]
    if found.verdict is Verdict.NOT_IDENTIFIABLE and not found.channels:
        rejected += _unseen(columns, names, left_out or {})
    return replace(found, rejected=tuple(rejected))


def absence(name: str, left_out: Mapping[str, str]) -> str:
    """That a column is not there, and why."""
    return f"{name} was left out ({left_out[name]})" if name in left_out else f"{name} is missing"


def _named(each: Rejected, said: Mapping[str, str]) -> Rejected:
    match = _NO_READING.search(each.reason)
    roles = [] if match is None else match[1].split(" or ")
    if not roles or any(role not in said for role in roles):
        return each
    return Rejected(each.id, _NO_READING.sub(" and ".join(said[role] for role in roles), each.reason))


def _unseen(columns: Columns, names: Mapping[str, str], left_out: Mapping[str, str]) -> Sequence[Rejected]:
    """Where no wheel is measured nothing can be told, of a gyro neither: it turns with the wheels."""
    wheels = [name for role, name in names.items() if role.startswith(("bemf", "speed"))]
    if any(name in columns and np.isfinite(columns[name]).sum() >= FEWEST for name in wheels):
        return ()
    broken = [absence(name, left_out) for name in wheels if name in left_out]
    sides = (" or ".join(names[f"{kind}_{side}"] for kind in ("bemf", "speed")) for side in ("left", "right"))
    missing = " and ".join(broken) if broken else f"{' and '.join(sides)} are missing"
    reason = f"not identifiable: {missing}: no wheel's motion is known"
    return [Rejected(each, reason) for each in EVERY_GROUP]
