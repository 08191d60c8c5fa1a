"""Causes that are equivalent if the wheels were driven in one direction only.

More friction, more friction in the driven direction and a slope against that direction are the same torque in
such a drive. Their columns differ where a wheel breaks loose or stops, at a point at which one of them is
already active. So the linear model does not lead from one to another, and one was reported with a probability
of 1 although another was equally likely.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.select.set_scoring import overlaps_none

FRICTION, FRICTION_BY_DIRECTION, SLOPE = "friction.coulomb", "friction.direction_dependent", "drive.slope"
ONE_WAY_EQUIVALENTS = (FRICTION, FRICTION_BY_DIRECTION, SLOPE)
MAX_REVERSE_SHARE = 0.05
"""Bound on a wheel's readings in the opposite direction, relative to its largest reading, for a drive in one
direction."""
IGNORED_SHARE = 0.01
"""Share of the bins that may exceed that bound."""
MAX_SIZE_WIDTHS, SIZES_TRIED = 4.0, 161
"""Largest size of an equivalent cause, in widths, and the number of sizes tried."""


def one_way_direction(features: Features) -> int:
    """1 if all wheels were driven forwards only, -1 if backwards only, 0 otherwise."""
    ways = set()
    for index, role in enumerate(features.roles):
        if role in WHEELS:
            back, forth = np.nanquantile(features.measured[:, index], [IGNORED_SHARE, 1.0 - IGNORED_SHARE])
            limit = MAX_REVERSE_SHARE * max(forth, -back)
            ways.add(1 if -back < limit else -1 if forth < limit else 0)
    return ways.pop() if len(ways) == 1 else 0


def one_way_equivalents(problem: Problem, point: Point, name: str) -> Iterator[tuple[str, Point]]:
    """For a drive in one direction: each equivalent of a cause, and the point at which it replaces the cause
    with the same torque."""
    way = one_way_direction(problem.features) if name in ONE_WAY_EQUIVALENTS else 0
    less = point.without_cause(name)
    for other in ONE_WAY_EQUIVALENTS if way else ():
        if other != name and other in problem.causes and overlaps_none(other, less.active):
            sizes = np.linspace(-MAX_SIZE_WIDTHS, MAX_SIZE_WIDTHS, SIZES_TRIED)
            torques = np.array([_added_holding_torque(problem, other, size, way) for size in sizes])
            order = np.argsort(torques)
            wanted = _added_holding_torque(problem, name, float(point.active[name][0]), way)
            u = np.zeros(problem.causes[other].size)
            u[0] = np.interp(wanted, torques[order], sizes[order])
            yield other, less.with_cause(other, u)


def _added_holding_torque(problem: Problem, name: str, size: float, way: int) -> float:
    """Torque (N m) by which a cause of that size holds each wheel back, beyond that of the nominal robot."""
    cause, settings = problem.causes[name], dict(problem.neutral)
    cause.apply(settings, [size, *[0.0] * (cause.size - 1)])
    return _holding_torque(settings, way) - _holding_torque(problem.neutral, way)


def _holding_torque(settings: Settings, way: int) -> float:
    """Torque (N m) that holds each wheel back in direction `way` (1 or -1)."""
    lean = way * settings[FRICTION_BY_DIRECTION, "left", "asymmetry"]
    return settings[FRICTION, "left", "torque"] * (1.0 + lean) - way * settings[SLOPE, None, "along_x"]
