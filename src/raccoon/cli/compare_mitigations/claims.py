"""What the paper says of the mitigations, held to the measured cells."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raccoon.cli.compare_mitigations.measure import METHODS, Cells, End
from raccoon.cli.compare_mitigations.robots import BATTERY, DRAWN, MATCH, REPLACED

HIGH = 95.0
FUSION, PID, IMU, STATIC = (
    "back-EMF + IMU fusion",
    "wheel PID on back-EMF",
    "IMU heading only",
    "static k",
)
ALIKE = 1e-3
"""m. Nearer than that two methods are alike: both go by a tape that is read to no better."""


@dataclass(frozen=True, slots=True)
class Claim:
    """Something the paper says; held: whether the numbers do, None where they were not measured."""

    text: str
    numbers: str
    held: bool | None


def high(ends: list[End], field: str) -> float:
    """95th percentile of one error."""
    return float(np.percentile([getattr(each, field) for each in ends], HIGH))


def off(ends: list[End]) -> float:
    """95th percentile of how far from the goal it ends, m."""
    return float(np.percentile([math.hypot(each.distance, each.lateral) for each in ends], HIGH))


def claims(cells: Cells) -> list[Claim]:
    """The paper's ranking, each step held to the numbers (m from the goal after 1 m)."""
    return [
        _better(cells, "A fresh battery helps", "fresh battery", "none", BATTERY),
        _alike(
            cells, "Scaling at 100 % cannot give what is missing", "voltage scaling, 100 %", "none", BATTERY
        ),
        _better(
            cells, "Scaling works at 80 %", "voltage scaling, 80 %", "voltage scaling, 100 %", BATTERY, 0.2
        ),
        _better(cells, "Matching motors by swapping helps", "motor swapping", "none", DRAWN),
        _better(cells, "Static k is more robust than swapping", STATIC, "motor swapping", DRAWN),
        _worse(cells, "Static k is lost when a motor is replaced", STATIC),
        _better(cells, "The wheel PID beats static k on any battery", PID, STATIC, BATTERY),
        _better(cells, "An IMU keeps the heading of unequal motors", IMU, "none", DRAWN, 0.5),
        _better(cells, "Fusion keeps a replaced motor's heading, back-EMF does not", FUSION, PID, REPLACED),
        *(_best(cells, condition) for condition in (BATTERY, DRAWN, MATCH, REPLACED)),
    ]


def _metre(cells: Cells, method: str, condition: str) -> float | None:
    ends = cells.get((method, condition, "1 m"))
    return None if ends is None else off(ends)


def _better(cells: Cells, text: str, better: str, worse: str, condition: str, share: float = 1.0) -> Claim:
    return _compared(cells, text, better, worse, condition, lambda one, other: one < share * other)


def _alike(cells: Cells, text: str, one: str, other: str, condition: str) -> Claim:
    return _compared(cells, text, one, other, condition, lambda first, second: first > 0.8 * second)


def _compared(
    cells: Cells, text: str, one: str, other: str, condition: str, holds: Callable[[float, float], bool]
) -> Claim:
    first, second = _metre(cells, one, condition), _metre(cells, other, condition)
    if first is None or second is None:
        return Claim(text, f"needs {condition}", None)
    numbers = f"{condition}: {1e3 * first:.1f} mm against {1e3 * second:.1f} mm ({other})"
    return Claim(text, numbers, holds(first, second))


def _worse(cells: Cells, text: str, method: str) -> Claim:
    before, after = _metre(cells, method, DRAWN), _metre(cells, method, REPLACED)
    if before is None or after is None:
        return Claim(text, f"needs {REPLACED}", None)
    return Claim(text, f"{1e3 * before:.1f} mm, replaced {1e3 * after:.1f} mm", after > 3.0 * before)


def _best(cells: Cells, condition: str) -> Claim:
    text = f"Fusion is best of all: {condition}"
    found = {method: _metre(cells, method, condition) for method in METHODS}
    known = {method: value for method, value in found.items() if value is not None}
    if len(known) < len(METHODS):
        return Claim(text, f"needs {condition}", None)
    order = sorted(known, key=lambda method: known[method])
    numbers = ", ".join(f"{method} {1e3 * known[method]:.1f} mm" for method in order[:3])
    return Claim(text, numbers, known[FUSION] <= known[order[0]] + ALIKE)
