"""The paper's claims about the mitigations, compared with the measured cells."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raccoon.cli.compare_mitigations.measure import METHODS, Cells, End
from raccoon.cli.compare_mitigations.robots import BATTERY, DRAWN, MATCH, REPLACED

PERCENTILE = 95.0
FUSION, PID, IMU, STATIC = (
    "back-EMF + IMU fusion",
    "wheel PID on back-EMF",
    "IMU heading only",
    "static k",
)
ALIKE = 1e-3
"""Difference, m, up to which two methods count as equal: both depend on a tape that is read no more
precisely."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the paper, the measured numbers, and whether they support it (held; None if not
    measured)."""

    text: str
    numbers: str
    held: bool | None


def error_percentile(ends: list[End], field: str) -> float:
    """95th percentile of one error, in the unit of the field of `End`."""
    return float(np.percentile([getattr(each, field) for each in ends], PERCENTILE))


def goal_distance_percentile(ends: list[End]) -> float:
    """95th percentile of the distance from the goal at the end, m."""
    return float(np.percentile([math.hypot(each.distance, each.lateral) for each in ends], PERCENTILE))


def claims(cells: Cells) -> list[Claim]:
    """The paper's ranking, each step compared with the measured distance from the goal after 1 m."""
    return [
        _claim_better(cells, "A fresh battery helps", "fresh battery", "none", BATTERY),
        _claim_alike(
            cells, "Scaling at 100 % cannot give what is missing", "voltage scaling, 100 %", "none", BATTERY
        ),
        _claim_better(
            cells, "Scaling works at 80 %", "voltage scaling, 80 %", "voltage scaling, 100 %", BATTERY, 0.2
        ),
        _claim_better(cells, "Matching motors by swapping helps", "motor swapping", "none", DRAWN),
        _claim_better(cells, "Static k is more robust than swapping", STATIC, "motor swapping", DRAWN),
        _claim_worse_when_replaced(cells, "Static k is lost when a motor is replaced", STATIC),
        _claim_better(cells, "The wheel PID beats static k on any battery", PID, STATIC, BATTERY),
        _claim_better(cells, "An IMU keeps the heading of unequal motors", IMU, "none", DRAWN, 0.5),
        _claim_better(
            cells, "Fusion keeps a replaced motor's heading, back-EMF does not", FUSION, PID, REPLACED
        ),
        *(_claim_best(cells, condition) for condition in (BATTERY, DRAWN, MATCH, REPLACED)),
    ]


def _metre_error(cells: Cells, method: str, condition: str) -> float | None:
    ends = cells.get((method, condition, "1 m"))
    return None if ends is None else goal_distance_percentile(ends)


def _claim_better(
    cells: Cells, text: str, better: str, worse: str, condition: str, share: float = 1.0
) -> Claim:
    return _compare_methods(cells, text, better, worse, condition, lambda one, other: one < share * other)


def _claim_alike(cells: Cells, text: str, one: str, other: str, condition: str) -> Claim:
    return _compare_methods(cells, text, one, other, condition, lambda first, second: first > 0.8 * second)


def _compare_methods(
    cells: Cells, text: str, one: str, other: str, condition: str, holds: Callable[[float, float], bool]
) -> Claim:
    first, second = _metre_error(cells, one, condition), _metre_error(cells, other, condition)
    if first is None or second is None:
        return Claim(text, f"needs {condition}", None)
    numbers = f"{condition}: {1e3 * first:.1f} mm against {1e3 * second:.1f} mm ({other})"
    return Claim(text, numbers, holds(first, second))


def _claim_worse_when_replaced(cells: Cells, text: str, method: str) -> Claim:
    before, after = _metre_error(cells, method, DRAWN), _metre_error(cells, method, REPLACED)
    if before is None or after is None:
        return Claim(text, f"needs {REPLACED}", None)
    return Claim(text, f"{1e3 * before:.1f} mm, replaced {1e3 * after:.1f} mm", after > 3.0 * before)


def _claim_best(cells: Cells, condition: str) -> Claim:
    text = f"Fusion is best of all: {condition}"
    found = {method: _metre_error(cells, method, condition) for method in METHODS}
    known = {method: value for method, value in found.items() if value is not None}
    if len(known) < len(METHODS):
        return Claim(text, f"needs {condition}", None)
    order = sorted(known, key=lambda method: known[method])
    numbers = ", ".join(f"{method} {1e3 * known[method]:.1f} mm" for method in order[:3])
    return Claim(text, numbers, known[FUSION] <= known[order[0]] + ALIKE)
