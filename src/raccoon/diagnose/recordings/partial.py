"""Drives with only part of the channels: what takes their place, and what cannot be known without them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import BatteryModel, Measured, RobotConfig
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.hypotheses import Cause
from raccoon.diagnose.log import ROLES
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

VOLTS = (
    "not identifiable: motor.N.voltage is recorded instead of motor.N.duty, so the driver hides the battery"
)
_NO_READING = re.compile(r"there is no (\w+) reading in this recording")


def commands_volts(columns: Columns, robot: RobotConfig) -> bool:
    """Whether both wheels' commands are volts."""
    names = [f"motor.{port}." for port in (robot.drive.left, robot.drive.right)]
    return all(f"{each}voltage" in columns and f"{each}duty" not in columns for each in names)


def as_duty(columns: Columns, robot: RobotConfig) -> tuple[dict[str, Array], RobotConfig, tuple[Cause, ...]]:
    """Columns and robot in which the volts are duties of a stiff battery, and the causes that remain.

    A driver that commands volts makes the same of any battery, so its resistance and charge do not act.
    """
    ports = (robot.drive.left, robot.drive.right)
    volts = {port: np.asarray(columns[f"motor.{port}.voltage"], float) for port in ports}
    largest = max(float(np.nanmax(np.abs(each), initial=0.0)) for each in volts.values())
    supply = max(largest, robot.model.battery.open_circuit_voltage.value)
    kept = {name: each for name, each in columns.items() if name != "battery.voltage"}
    kept |= {f"motor.{port}.duty": each / supply for port, each in volts.items()}
    battery = BatteryModel(Measured(supply), Measured(0.0))
    causes = tuple(each for each in drive_causes() if not each.id.startswith("battery."))
    return kept, replace(robot, model=replace(robot.model, battery=battery)), causes


def without_battery(found: Diagnosis) -> Diagnosis:
    """A diagnosis of a drive in volts, with what that hides."""
    ids = ("battery.open_circuit_voltage", "battery.internal_resistance", "battery.discharge")
    return replace(found, rejected=(*found.rejected, *(Rejected(each, VOLTS) for each in ids)), model=None)


def with_columns_named(found: Diagnosis, columns: Columns, robot: RobotConfig) -> Diagnosis:
    """Reasons that speak of a missing reading, with the column's name."""
    ports = {"left": robot.drive.left, "right": robot.drive.right}
    names = {role: pattern.format(**ports) for role, (pattern, _, _) in ROLES.items()}
    rejected = [_named(each, names) for each in found.rejected]
    if found.verdict is Verdict.NOT_IDENTIFIABLE and not found.channels:
        rejected += _unseen(columns, names)
    return replace(found, rejected=tuple(rejected))


def _named(each: Rejected, names: Mapping[str, str]) -> Rejected:
    match = _NO_READING.search(each.reason)
    if match is None or match[1] not in names:
        return each
    return Rejected(each.id, _NO_READING.sub(f"{names[match[1]]} is missing", each.reason))


def _unseen(columns: Columns, names: Mapping[str, str]) -> Sequence[Rejected]:
    """Where no wheel is measured nothing of the drive train can be told."""
    wheels = {side: (names[f"bemf_{side}"], names[f"speed_{side}"]) for side in ("left", "right")}
    missing = [" or ".join(pair) for pair in wheels.values() if not any(each in columns for each in pair)]
    if not missing:
        return ()
    reason = f"not identifiable: {' and '.join(missing)} is missing: no wheel's motion is known"
    return [Rejected(each, reason) for each in ("motor.*", "friction.*", "drive.*", "actuation.*", "bemf.*")]
