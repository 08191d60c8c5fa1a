"""The likely ones of the sets of causes that are the same drive in other numbers, fitted.

Beside the lines of `symmetry` there is one that may be nearly the same drive. A gear that loses a share l of
its torque is one that loses none, with 1 / (1 - l) times the inertia and the friction, as long as its motor
drives it or coasts; only where the motor brakes it differs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_afresh
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.select.gates import gates
from raccoon.diagnose.select.set_scoring import apart
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.symmetry import (
    INERTIA,
    LEAST,
    LINES,
    MOST,
    Line,
    along,
    id_of,
    same_drives,
    total_of,
)

HOPE = 20.0
"""Log evidence, less the gates, that one may lack before it is fitted: one lacked 12 and led by 15 then."""
MOST_TWINS = 4
"""That are fitted, of those that are the same drive."""
GEAR = "friction.load_dependent"
_BY_CURRENT = ("motor.armature_resistance", "battery.", "motor.heating", "motor.current_limit")
LOADED: Line = {key: -power for key, power in LINES[1].items() if not key[0].startswith(_BY_CURRENT)}
"""Along which all that a motor has to move changes, and what it has for that stays."""


def fitted_twins(search: Search) -> list[tuple[str, Fit]]:
    """Each cause that a likely twin does without, and that twin fitted: with other base numbers its columns
    are others, and simulated anew."""
    twins = likely_twins(search.problem, search.fit.point)
    fits = fit_afresh(search.problem, search.whitener, [point for _, point in twins], 4)
    return [(name, fit) for (name, _), fit in zip(twins, fits, strict=True)]


def likely_twins(problem: Problem, point: Point) -> list[tuple[str, Point]]:
    """Of the same drives those that are not much less likely, the likeliest first. The misfit is the same, so
    robot.toml and the gates decide."""

    def worth(each: Point) -> float:
        vector = each.vector()
        return -0.5 * float(vector @ vector) - gates(each.active)

    def likeliest(drives: Iterator[tuple[str, Point]], most: int) -> list[tuple[str, Point]]:
        found = [(worth(other) - now, name, other) for name, other in drives]
        found.sort(key=lambda each: -each[0])
        return [(name, other) for lead, name, other in found[:most] if lead > -HOPE]

    now = worth(point)
    return [
        *likeliest(same_drives(problem, point), MOST_TWINS),
        *likeliest(_nearly_same(problem, point), 1),
    ]


def _nearly_same(problem: Problem, point: Point) -> Iterator[tuple[str, Point]]:
    """Each cause that is on, and a point without it, with other gears, that may nearly be the same drive."""
    drives = [(name, point) for name in point.active] + list(same_drives(problem, point))
    for name, drive in drives:
        other = geared(problem, drive)
        if other is not None and name not in other.active:
            yield name, other


def geared(problem: Problem, point: Point) -> Point | None:
    """Nearly the same drive with gears that lose as much torque as makes the inertia that of robot.toml, or
    with none that do where there are some; None where there is no such drive."""
    cause, u = problem.causes.get(GEAR), point.active.get(GEAR)
    inertias = [index for index, each in enumerate(problem.base) if id_of(each) == INERTIA]
    if cause is None or not inertias or not (u is not None or apart(GEAR, point.active)):
        return None
    own = cause.coordinates[0]
    if u is not None:
        factor = 1.0 / (1.0 - own.value(float(u[0])))
        point = point.without_cause(GEAR)
    else:
        bent = [math.log(problem.base[each].value(total_of(problem, point, each))) for each in inertias]
        factor = math.exp(-float(np.mean(bent)))
    if not LEAST < abs(math.log(factor)) < MOST or (u is None and factor > 1.0):
        return None
    other = along(problem, point, LOADED, factor)
    if other is None or u is not None:
        return other
    return problem.inside(other.with_cause(GEAR, np.array([(1.0 - factor) / own.value(1.0)])))
