"""Twins: sets of causes that are the same drive in other numbers. The likely ones are fitted.

In addition to the lines of `symmetry`, one more is nearly the same drive. A gear that loses a share l of its
torque acts like one that loses none, with 1 / (1 - l) times the inertia and the friction, while its motor
drives it or coasts; only where the motor brakes do the two differ.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_starts
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.select.gates import total_gate
from raccoon.diagnose.select.set_scoring import overlaps_none
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.symmetry import (
    INERTIA,
    MAX_LOG_FACTOR,
    MIN_LOG_FACTOR,
    SYMMETRY_LINES,
    SymmetryLine,
    cause_id_of,
    exact_twins,
    move_along_line,
    total_stds,
)

MAX_TWIN_DEFICIT = 20.0
"""Log evidence, less the gates, by which a twin may be behind to be fitted: one was 12 behind and then led by
15."""
MAX_TWINS = 4
"""Maximum number of exact twins that are fitted."""
GEAR_LOSS = "friction.load_dependent"
_ELECTRICAL = ("motor.armature_resistance", "battery.", "motor.heating", "motor.current_limit")
GEAR_LOSS_LINE: SymmetryLine = {
    key: -power for key, power in SYMMETRY_LINES[1].items() if not key[0].startswith(_ELECTRICAL)
}
"""The line along which all mechanical loads of a motor change while its torque does not."""


def fit_twins(search: Search) -> list[tuple[str, Fit]]:
    """For each likely twin the cause that it omits, and the twin's fit. Its columns are simulated anew, since
    its base numbers differ."""
    twins = find_likely_twins(search.problem, search.fit.point)
    fits = fit_starts(search.problem, search.whitener, [point for _, point in twins], 4)
    return [(name, fit) for (name, _), fit in zip(twins, fits, strict=True)]


def find_likely_twins(problem: Problem, point: Point) -> list[tuple[str, Point]]:
    """The twins of a point that are not much less likely, most likely first, each with the cause that it
    omits. The misfit is the same, so the priors and the gates decide."""

    def log_prior(each: Point) -> float:
        vector = each.vector()
        return -0.5 * float(vector @ vector) - total_gate(each.active)

    def likeliest(drives: Iterator[tuple[str, Point]], max_count: int) -> list[tuple[str, Point]]:
        found = [(log_prior(other) - current, name, other) for name, other in drives]
        found.sort(key=lambda each: -each[0])
        return [(name, other) for lead, name, other in found[:max_count] if lead > -MAX_TWIN_DEFICIT]

    current = log_prior(point)
    return [
        *likeliest(exact_twins(problem, point), MAX_TWINS),
        *likeliest(_approximate_twins(problem, point), 1),
    ]


def _approximate_twins(problem: Problem, point: Point) -> Iterator[tuple[str, Point]]:
    """Each active cause, and a point without it and with other gear losses that may be nearly the same
    drive."""
    drives = [(name, point) for name in point.active] + list(exact_twins(problem, point))
    for name, drive in drives:
        other = gear_loss_twin(problem, drive)
        if other is not None and name not in other.active:
            yield name, other


def gear_loss_twin(problem: Problem, point: Point) -> Point | None:
    """Nearly the same drive without the gear loss if there is one; otherwise with a gear loss at which the
    inertia is that of robot.toml. None if there is no such drive."""
    cause, u = problem.causes.get(GEAR_LOSS), point.active.get(GEAR_LOSS)
    inertias = [index for index, each in enumerate(problem.base) if cause_id_of(each) == INERTIA]
    if cause is None or not inertias or not (u is not None or overlaps_none(GEAR_LOSS, point.active)):
        return None
    own = cause.coordinates[0]
    if u is not None:
        factor = 1.0 / (1.0 - own.value(float(u[0])))
        point = point.without_cause(GEAR_LOSS)
    else:
        log_factors = [
            math.log(problem.base[each].value(total_stds(problem, point, each))) for each in inertias
        ]
        factor = math.exp(-float(np.mean(log_factors)))
    if not MIN_LOG_FACTOR < abs(math.log(factor)) < MAX_LOG_FACTOR or (u is None and factor > 1.0):
        return None
    other = move_along_line(problem, point, GEAR_LOSS_LINE, factor)
    if other is None or u is not None:
        return other
    return problem.inside(other.with_cause(GEAR_LOSS, np.array([(1.0 - factor) / own.value(1.0)])))
