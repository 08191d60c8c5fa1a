"""What a motor does at duty 0: it is shorted and brakes, or it coasts; or now one and now the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from raccoon.diagnose.drives.log import Log

BRAKING_SECONDS = 0.1
"""s after a release at which it is asked how much of the speed is left."""
MAX_BRAKED_SPEED = 0.4
"""Part of its speed that a motor has left after that, below which it brakes."""
MAX_SURELY_BRAKED, MIN_SURELY_COASTED = 0.25, 0.5
"""The same of a stop that surely braked, and of one that surely coasted, where a robot does both."""
MIN_BRAKING_RATIO = 1.6
"""Times what coasting takes of a speed, which is the same of any, that braking takes at least: friction alone
stops a wheel that is slow."""
MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.9, 1.5
"""Parts of a usual wheel's speed for its command between which it was before: at a wall it stops by that, and
at the end of a ramp the command has slowed it down already, which its reading is late to show."""
MIN_MOMENTS = 2
"""Moments of either kind from which a robot does both."""
SAME_MOMENT_S = 0.05
"""s within which both wheels are released at once."""
MIN_SPEED_SHARE = 0.15
"""Part of a wheel's largest speed from which it has to stop from."""
MIXED_STOPS_NOTE = (
    "at duty 0 the motors sometimes brake and sometimes coast, and the recording has no motor.N.brake: each "
    "stop is taken for what the wheels show it to be"
)


@dataclass(frozen=True, slots=True)
class Stop:
    """A release of one wheel (0 left, 1 right). row: its first at duty 0. speed_left: part of its speed after
    `BRAKING_SECONDS`. speed_lost: the rest, in the unit of its reading. speed_ratio: its speed over the
    command before."""

    wheel: int
    row: int
    speed_left: float
    speed_lost: float
    speed_ratio: float


def motors_brake(log: Log) -> bool:
    """Whether the motors brake at duty 0: a shorted motor stops within 0.1 s, one that coasts rolls on."""
    left = [each.speed_left for each in find_stops(log)]
    return bool(left) and float(np.median(left)) < MAX_BRAKED_SPEED


def with_brake_by_stop(log: Log) -> Log:
    """The log with what each stop was, where it does not say so itself and there were both kinds."""
    if log.brake is not None:
        return log
    moments = _group_stops(log, sorted(find_stops(log), key=lambda each: each.row))
    coasting = [each for each in moments if all(one.speed_left > MIN_SURELY_COASTED for one in each)]
    if len(coasting) < MIN_MOMENTS:
        return log
    usual = [one for each in coasting for one in each]
    lost = MIN_BRAKING_RATIO * float(np.median([one.speed_lost for one in usual]))
    share = float(np.median([one.speed_ratio for one in usual]))
    braking = [
        each
        for each in moments
        if all(
            one.speed_left < MAX_SURELY_BRAKED
            and one.speed_lost > lost
            and MIN_SPEED_RATIO < one.speed_ratio / share < MAX_SPEED_RATIO
            for one in each
        )
    ]
    if len(braking) < MIN_MOMENTS:
        return log
    brake = np.zeros(log.duty.shape, bool)
    for one in (one for each in braking for one in each):
        driven = np.flatnonzero(log.duty[one.row :, one.wheel])
        brake[one.row : one.row + int(driven[0]) if len(driven) else None, one.wheel] = True
    return replace(log, brake=brake, notes=(*log.notes, MIXED_STOPS_NOTE))


def _group_stops(log: Log, found: Sequence[Stop]) -> list[list[Stop]]:
    """Stops of both wheels at once together."""
    moments: list[list[Stop]] = []
    for each in found:
        if moments and log.time[each.row] - log.time[moments[-1][0].row] < SAME_MOMENT_S:
            moments[-1].append(each)
        else:
            moments.append([each])
    return moments


def find_stops(log: Log) -> Iterator[Stop]:
    """Each release of a turning motor that is long enough."""
    for index, side in enumerate(("left", "right")):
        wheel = log.wheel(side)
        if wheel is None:
            continue
        duty, size = log.duty[:, index], np.abs(wheel.values)
        for row in np.flatnonzero((duty[1:] == 0.0) & (duty[:-1] != 0.0)) + 1:
            later = int(np.searchsorted(log.time, log.time[row] + BRAKING_SECONDS))
            if (
                later < len(log.time)
                and not duty[row:later].any()
                and size[row] > MIN_SPEED_SHARE * np.nanmax(size)
            ):
                left, share = float(size[later] / size[row]), float(size[row] / abs(duty[row - 1]))
                if np.isfinite(left):
                    yield Stop(index, int(row), left, float(size[row] - size[later]), share)
