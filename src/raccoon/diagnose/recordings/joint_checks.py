"""Checks that several recordings can be fitted together: all must be different drives by duty."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.log_joining import naming_recording
from raccoon.diagnose.recordings.channels.volt_commands import has_volt_commands
from raccoon.diagnose.recordings.kind import Kind, kind_of

Columns = Mapping[str, NDArray[np.float64]]


def check_joint_recordings(recordings: Sequence[Columns], robot: RobotConfig) -> None:
    """Raise TraceError if one of several recordings is no drive, or is there twice. recordings: without
    repeated rows."""
    if len(recordings) == 1:
        return
    for number, each in enumerate(recordings):
        with naming_recording(number):
            if (kind := kind_of(each, robot)) is not Kind.DRIVE:
                raise TraceError(f"it is of {kind}; only drives are diagnosed together")
    for (first_index, first), (second_index, second) in combinations(enumerate(recordings), 2):
        if _has_same_samples(first, second):
            raise TraceError(
                f"recording {second_index + 1}: its samples are those of recording {first_index + 1}"
            )


def _has_same_samples(one: Columns, two: Columns) -> bool:
    names = [name for name in one if name in two and name.startswith(("motor.", "imu."))]
    return bool(names) and all(np.array_equal(one[name], two[name], equal_nan=True) for name in names)


def check_joint_commands(recordings: Sequence[Columns], robot: RobotConfig) -> None:
    """Raise TraceError if one of several recordings has voltage commands, which are only converted for a
    single recording and its battery."""
    if len(recordings) == 1:
        return
    for number, each in enumerate(recordings):
        if has_volt_commands(each, robot):
            raise TraceError(f"recording {number + 1}: its commands are volts; diagnose it by itself")
