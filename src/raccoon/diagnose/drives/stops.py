"""What a motor does at duty 0: it is shorted and brakes, or it coasts; or now one and now the other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import Log

Array = NDArray[np.float64]

BRAKING_SECONDS = 0.1
BRAKES = 0.4
"""Part of its speed that a motor has left after that, below which it brakes."""
SURELY, SURELY_NOT = 0.25, 0.5
"""The same where a robot does both, and nothing is between."""
EACH = 2
"""Stops of either kind from which a robot does both."""
FAST = 0.15
"""Part of a wheel's largest speed from which it has to stop from."""
BOTH = (
    "at duty 0 the motors sometimes brake and sometimes coast, and the recording has no motor.N.brake: each "
    "stop is taken for what the wheels show it to be"
)


@dataclass(frozen=True, slots=True)
class Stop:
    """Of one wheel (0 left, 1 right), its first row at duty 0, and what part of its speed is left later."""

    wheel: int
    row: int
    left: float


def brakes(log: Log) -> bool:
    """Whether the motors brake at duty 0: a shorted motor stops within 0.1 s, one that coasts rolls on."""
    left = [each.left for each in stops(log)]
    return bool(left) and float(np.median(left)) < BRAKES


def with_stops(log: Log) -> Log:
    """The log with what each stop was, where it does not say so itself and there were both kinds."""
    if log.brake is not None:
        return log
    found = list(stops(log))
    short = [each for each in found if each.left < SURELY]
    long = [each for each in found if each.left > SURELY_NOT]
    if min(len(short), len(long)) < EACH or len(short) + len(long) < len(found):
        return log
    brake = np.zeros(log.duty.shape, bool)
    for wheel in (0, 1):
        own = {each.row: each.left < SURELY for each in found if each.wheel == wheel}
        other = {each.row: each.left < SURELY for each in found if each.wheel != wheel}
        idle = log.duty[:, wheel] == 0.0
        now = False
        for row in range(len(idle)):
            now = own.get(row, other.get(row, now))
            brake[row, wheel] = now and idle[row]
    return replace(log, brake=brake, notes=(*log.notes, BOTH))


def stops(log: Log) -> Iterator[Stop]:
    """Each release of a turning motor that is long enough."""
    for index, side in enumerate(("left", "right")):
        wheel = log.wheel(side)
        if wheel is None:
            continue
        duty, size = log.duty[:, index], np.abs(wheel.values)
        for row in np.flatnonzero((duty[1:] == 0.0) & (duty[:-1] != 0.0)) + 1:
            later = int(np.searchsorted(log.time, log.time[row] + BRAKING_SECONDS))
            if later < len(log.time) and not duty[row:later].any() and size[row] > FAST * np.nanmax(size):
                left = float(size[later] / size[row])
                if np.isfinite(left):
                    yield Stop(index, int(row), left)
