"""Whether motors at duty 0 brake (are shorted) or coast, or sometimes one and sometimes the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from raccoon.diagnose.drives.log import Log

BRAKING_SECONDS = 0.1
"""Time after a release, s, at which the remaining speed is evaluated."""
MAX_BRAKED_SPEED = 0.4
"""Remaining share of the speed after that time, below which a motor brakes."""
MAX_SURELY_BRAKED, MIN_SURELY_COASTED = 0.25, 0.5
"""The same for a stop that clearly braked, and for one that clearly coasted, if a robot does both."""
MIN_BRAKING_RATIO = 1.6
"""Least ratio of the speed that a braking motor loses to the speed that a coasting one loses, which does not
depend on its speed: friction alone stops a slow wheel."""
MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.9, 1.5
"""Range of the wheel's speed over its command before a stop, relative to the usual ratio: below it a wall
stops the wheel; above it, at the end of a ramp, the command has already slowed the wheel, which its reading
shows late."""
MIN_MOMENTS = 2
"""Least number of stops of either kind for a robot that does both."""
SAME_MOMENT_S = 0.05
"""Time, s, within which the releases of both wheels count as one."""
MIN_SPEED_SHARE = 0.15
"""Least speed at a release, as a share of the wheel's largest speed."""
MIXED_STOPS_NOTE = (
    "at duty 0 the motors sometimes brake and sometimes coast, and the recording has no motor.N.brake: each "
    "stop is classified by what the wheels show"
)


@dataclass(frozen=True, slots=True)
class Stop:
    """A release of one wheel. wheel: 0 left, 1 right. row: first one at duty 0. speed_left: share of the
    speed after `BRAKING_SECONDS`. speed_lost: the lost speed, in the reading's unit. speed_ratio: speed over
    the duty before."""

    wheel: int
    row: int
    speed_left: float
    speed_lost: float
    speed_ratio: float


def motors_brake(log: Log) -> bool:
    """Whether the motors brake at duty 0: a shorted motor stops within 0.1 s, a coasting one rolls on."""
    left = [each.speed_left for each in find_stops(log)]
    return bool(left) and float(np.median(left)) < MAX_BRAKED_SPEED


def with_brake_by_stop(log: Log) -> Log:
    """The log with `brake` by the kind of each stop, if the recording does not give it and has stops of both
    kinds; else the same log."""
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
    """The stops, grouped by release: those of both wheels at the same time together."""
    moments: list[list[Stop]] = []
    for each in found:
        if moments and log.time[each.row] - log.time[moments[-1][0].row] < SAME_MOMENT_S:
            moments[-1].append(each)
        else:
            moments.append([each])
    return moments


def find_stops(log: Log) -> Iterator[Stop]:
    """The releases of a turning motor that last long enough."""
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
