"""What is one and the same to wheels that were driven one way only.

More friction, more of it in the direction that was driven, and a table that pulls against it are one
torque there. Their columns differ where a wheel breaks loose or stops, at a point at which one of them is on
already, so straight lines do not lead from one to another: one had probability 1 that was as well another.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.select.set_scoring import apart

FRICTION, UNEVEN, SLOPE = "friction.coulomb", "friction.direction_dependent", "drive.slope"
ALIKE = (FRICTION, UNEVEN, SLOPE)
BACK = 0.05
"""Part of its largest reading up to which a wheel was not driven the other way."""
SEEN = 0.01
"""Part of the bins that may read more."""
WIDEST, TRIED = 4.0, 161
"""Widths up to which one may be off, and how many of its sizes are looked at."""


def way_of(features: Features) -> int:
    """1 where all wheels went forwards only, -1 where backwards only, 0 where they went both ways."""
    ways = set()
    for index, role in enumerate(features.roles):
        if role in WHEELS:
            back, forth = np.nanquantile(features.measured[:, index], [SEEN, 1.0 - SEEN])
            there = max(forth, -back)
            ways.add(1 if -back < BACK * there else -1 if forth < BACK * there else 0)
    return ways.pop() if len(ways) == 1 else 0


def same_one_way(problem: Problem, point: Point, name: str) -> Iterator[tuple[str, Point]]:
    """Of a drive one way only: what else of these a cause may be, as much torque in its place."""
    way = way_of(problem.features) if name in ALIKE else 0
    less = point.without_cause(name)
    for other in ALIKE if way else ():
        if other != name and other in problem.causes and apart(other, less.active):
            sizes = np.linspace(-WIDEST, WIDEST, TRIED)
            torques = np.array([_against(problem, other, size, way) for size in sizes])
            order = np.argsort(torques)
            wanted = _against(problem, name, float(point.active[name][0]), way)
            u = np.zeros(problem.causes[other].size)
            u[0] = np.interp(wanted, torques[order], sizes[order])
            yield other, less.with_cause(other, u)


def _against(problem: Problem, name: str, size: float, way: int) -> float:
    """N m by which a cause of that size holds each wheel back, beyond what is known to."""
    cause, there = problem.causes[name], dict(problem.neutral)
    cause.apply(there, [size, *[0.0] * (cause.size - 1)])
    return _held_back(there, way) - _held_back(problem.neutral, way)


def _held_back(settings: Settings, way: int) -> float:
    """N m that hold each wheel back."""
    lean = way * settings[UNEVEN, "left", "asymmetry"]
    return settings[FRICTION, "left", "torque"] * (1.0 + lean) - way * settings[SLOPE, None, "along_x"]
