"""Drives with only part of the channels: what takes their place, and what cannot be known without them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import column_names, is_read
from raccoon.diagnose.result import Diagnosis, Rejected, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

_NO_READING = re.compile(r"there is no (\w+(?: or \w+)*) reading in this recording")
EVERY_GROUP = ("battery.*", "motor.*", "friction.*", "drive.*", "actuation.*", "bemf.*", "imu.*")


def with_columns_named(
    found: Diagnosis, columns: Columns, robot: RobotConfig, left_out: Mapping[str, str]
) -> Diagnosis:
    """Reasons that speak of a missing reading, with the column's name. left_out: columns that were recorded
    and not used, and why."""
    names = column_names(robot)
    said = {role: absence(name, left_out) for role, name in names.items()}
    rejected = [_named(each, said) for each in found.rejected]
    if found.verdict is Verdict.NOT_IDENTIFIABLE and not found.channels:
        rejected += _unseen(columns, names, left_out)
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
    if any(is_read(columns, name) for name in wheels):
        return ()
    broken = [absence(name, left_out) for name in wheels if name in left_out]
    sides = (" or ".join(names[f"{kind}_{side}"] for kind in ("bemf", "speed")) for side in ("left", "right"))
    missing = " and ".join(broken) if broken else f"{' and '.join(sides)} are missing"
    reason = f"not identifiable: {missing}: no wheel's motion is known"
    return [Rejected(each, reason) for each in EVERY_GROUP]
