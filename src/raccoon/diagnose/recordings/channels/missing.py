"""Names missing columns in the reasons for causes that were not judged."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import column_names, has_readings
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

_NO_READING = re.compile(r"there is no (\w+(?: or \w+)*) reading in this recording")
CAUSE_GROUPS = ("battery.*", "motor.*", "friction.*", "drive.*", "actuation.*", "bemf.*", "imu.*")


def with_missing_columns_named(
    found: Diagnosis, columns: Columns, robot: RobotConfig, left_out: Mapping[str, str]
) -> Diagnosis:
    """The diagnosis with the column's name in each reason that speaks of a missing reading.

    left_out: columns that were recorded and not used, with the reasons.
    """
    names = column_names(robot)
    reasons = {role: describe_absence(name, left_out) for role, name in names.items()}
    rejected = [_with_columns_named(each, reasons) for each in found.rejected]
    if found.verdict is Verdict.NOT_IDENTIFIABLE and not found.channels:
        rejected += _rejected_without_wheels(columns, names, left_out)
    return replace(found, rejected=tuple(rejected))


def describe_absence(name: str, left_out: Mapping[str, str]) -> str:
    """Text that a column is missing or was left out, and why."""
    return f"{name} was left out ({left_out[name]})" if name in left_out else f"{name} is missing"


def _with_columns_named(rejected: Rejected, reasons: Mapping[str, str]) -> Rejected:
    match = _NO_READING.search(rejected.reason)
    roles = [] if match is None else match[1].split(" or ")
    if not roles or any(role not in reasons for role in roles):
        return rejected
    return Rejected(
        rejected.id, _NO_READING.sub(" and ".join(reasons[role] for role in roles), rejected.reason)
    )


def _rejected_without_wheels(
    columns: Columns, names: Mapping[str, str], left_out: Mapping[str, str]
) -> Sequence[Rejected]:
    """All groups of causes as rejected if no wheel is measured, including the gyro's, which turns with the
    wheels; empty otherwise."""
    wheels = [name for role, name in names.items() if role.startswith(("bemf", "speed"))]
    if any(has_readings(columns, name) for name in wheels):
        return ()
    broken = [describe_absence(name, left_out) for name in wheels if name in left_out]
    sides = (" or ".join(names[f"{kind}_{side}"] for kind in ("bemf", "speed")) for side in ("left", "right"))
    missing = " and ".join(broken) if broken else f"{' and '.join(sides)} are missing"
    reason = f"not identifiable: {missing}: no wheel's motion is known"
    return [Rejected(each, reason) for each in CAUSE_GROUPS]
