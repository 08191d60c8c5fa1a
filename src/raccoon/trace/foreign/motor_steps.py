"""Wombat motor steps: open-loop steps of a single motor, with the command in per cent and a filtered speed.

The recorded speed is y[i] = 0.2 y[i-1] + 0.8 x[i], where x is the step of the position counter over the time
between two samples. So x can be recovered to the printed digits, and with it what the filter hides: the first
sample contains the earlier state of the filter (up to 2000 rad/s) and spoils the following ones, and where x
is 0 between moving samples the counter was read twice between two updates. The first sample and the repeated
ones contain no information about the motor; they are blank and reported.
"""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.trace.foreign.table import read_table
from raccoon.trace.recording import Column, Recording

HEADER = ("time_s", "command_percent", "velocity_rad_s")
FILTER_SHARE = 0.2
PRINTED = 0.5e-4
"""Largest rounding error of a printed speed, rad/s."""
ONE_COUNT = 0.4
"""Speed of one count a sample, rad/s. Below it the remains of the filter's first state do not look like
motion."""
LONGEST_REPEAT = 0.05
"""Longest time without a new count that may be repetition, s; longer is standstill."""
TURNED_BACK = 0.2
"""Share of the travel by which a motor must turn back to be reported as reversed."""

Mask = NDArray[np.bool_]


def read_motor_steps(path: str | Path) -> Recording:
    """Read motor steps: columns `motor.N.duty`, `motor.N.speed` (rad/s, without the filter, blank without a
    measurement) and `motor.N.speed_recorded` (as in the file). N comes from the file's name, 0 if it has
    none.

    `problems` says what is blank and why, and whether the motor turned against its command or reversed.
    Raises TraceError if the file is not of this kind.
    """
    path = Path(path)
    table = read_table(path, HEADER, header=True)
    found = re.search(r"motor_(\d)", path.stem)
    port = int(found.group(1)) if found else 0
    time, recorded = table["time_s"], table["velocity_rad_s"]
    if len(time) < 3:
        raise TraceError(f"{path}: {len(time)} samples: at least 3 are needed to undo the filter")
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        raise TraceError(f"{path}: line {back[0] + 3}: time_s is {float(time[back[0] + 1])}: must go up")
    raw = np.full(len(time), np.nan)
    raw[1:] = (recorded[1:] - FILTER_SHARE * recorded[:-1]) / (1.0 - FILTER_SHARE)
    repeated = _repeated(time, raw)
    speed = _speed(time, raw, repeated)
    columns = {
        "t": time,
        f"motor.{port}.duty": table["command_percent"] / 100.0,
        f"motor.{port}.speed": speed,
        f"motor.{port}.speed_recorded": recorded,
    }
    problems = _doubts(float(recorded[0]), repeated) + _direction(time, table["command_percent"], speed)
    return Recording(columns, problems=[f"motor {port}: {problem}" for problem in problems])


def _repeated(time: Column, raw: Column) -> Mask:
    """Whether each sample has no new count in a gap short enough to be repetition."""
    repeated = np.zeros(len(time), np.bool_)
    fresh = np.flatnonzero(np.abs(raw) > 2.0 * PRINTED)
    for before, after in pairwise(fresh):
        if time[after] - time[before] <= LONGEST_REPEAT:
            repeated[before + 1 : after] = True
    return repeated


def _speed(time: Column, raw: Column, repeated: Mask) -> Column:
    """Speed since the last sample with information: the travel of repeated samples is in the next one."""
    speed = raw.copy()
    since = 0
    for index in range(1, len(time)):
        if repeated[index]:
            speed[index] = np.nan
        else:
            speed[index] *= (time[index] - time[index - 1]) / (time[index] - time[since])
            since = index
    return speed


def _doubts(first: float, repeated: Mask) -> list[str]:
    doubts = []
    if abs(first) > ONE_COUNT:
        count = math.ceil(math.log(abs(first) / ONE_COUNT) / -math.log(FILTER_SHARE))
        doubts.append(
            f"the first sample is stale: a filter decays from {first:.1f} rad/s over {count} samples"
        )
    if repeated.any():
        doubts.append(f"{repeated.sum()} samples ({100.0 * repeated.mean():.0f} %) repeat the last count")
    return doubts


def _direction(time: Column, command: Column, speed: Column) -> list[str]:
    """Problems: the motor turned against its command, or reversed under it."""
    fresh = np.flatnonzero(np.isfinite(speed))
    travel = np.cumsum(speed[fresh] * np.diff(time[fresh], prepend=time[0]))
    farthest = int(np.argmax(np.abs(travel)))
    doubts = []
    if travel[farthest] * np.sign(command[0]) < 0.0:
        doubts.append(f"a command of {float(command[0]):g} % turns it backwards")
    if abs(travel[-1] - travel[farthest]) > TURNED_BACK * abs(travel[farthest]):
        doubts.append(f"it turns back at {float(time[fresh[farthest]]):.2f} s under a constant command")
    return doubts
