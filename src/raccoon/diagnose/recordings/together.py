"""Whether several recordings can be fitted together: drives, by duty, and no samples twice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.joined import said_of_recording
from raccoon.diagnose.recordings.channels.volts import commands_volts
from raccoon.diagnose.recordings.kind import Kind, kind_of

Columns = Mapping[str, NDArray[np.float64]]


def check_drives(every: Sequence[Columns], robot: RobotConfig) -> None:
    """Raise TraceError where one of several is no drive, or is there twice. every: each row once."""
    if len(every) == 1:
        return
    for number, each in enumerate(every):
        with said_of_recording(number):
            if (kind := kind_of(each, robot)) is not Kind.DRIVE:
                raise TraceError(f"it is of {kind}; only drives are diagnosed together")
    for (one, first), (two, second) in combinations(enumerate(every), 2):
        if _same(first, second):
            raise TraceError(f"recording {two + 1}: its samples are those of recording {one + 1}")


def _same(one: Columns, two: Columns) -> bool:
    moving = [name for name in one if name in two and name.startswith(("motor.", "imu."))]
    return bool(moving) and all(np.array_equal(one[name], two[name], equal_nan=True) for name in moving)


def check_commands(every: Sequence[Columns], robot: RobotConfig) -> None:
    """Raise TraceError where one of several has volts for commands: what makes volts of a battery is one."""
    if len(every) == 1:
        return
    for number, each in enumerate(every):
        if commands_volts(each, robot):
            raise TraceError(f"recording {number + 1}: its commands are volts; diagnose it by itself")
