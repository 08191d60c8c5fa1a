"""Which causes may change as much as the one that is ranked first: no order is surer than its sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.diagnose.result import CauseResult

FORM_ERROR = 0.1
"""Relative error of what a cause changes however sure its number is, as no form is quite the robot's: of
causes alone it was said 0.92 to 1.33 times what it was, one in ten beyond either."""
MIN_SEPARATION_STDS = 1.5
"""Standard deviations of the ratio of two causes' changes from which the larger one is surely larger: by
chance the other one is, one time in fifteen."""


def causes_of_similar_size(causes: Sequence[CauseResult]) -> tuple[CauseResult, ...]:
    """Causes behind the first that may change as much as it does; none where the first does not matter
    itself, or where no drive was recorded. causes: in their order."""
    if not causes or causes[0].is_negligible or not causes[0].unabsorbed > 0.0:
        return ()
    return tuple(
        each
        for each in causes[1:]
        if not each.is_negligible and _separation_stds(causes[0], each) < MIN_SEPARATION_STDS
    )


def similar_size_text(cause: CauseResult, causes: Sequence[CauseResult]) -> str:
    """The same in words, for the first of these causes; "" for the others, and where it is none."""
    names = [each.name for each in causes_of_similar_size(causes)] if cause.rank == 1 else []
    return f"about as much as {' and '.join(names)}" if names else ""


def _separation_stds(first: CauseResult, other: CauseResult) -> float:
    """By how many of its standard deviations the logarithm of the ratio of their changes is above 0."""
    if not other.unabsorbed > 0.0:
        return math.inf
    return math.log(first.unabsorbed / other.unabsorbed) / math.hypot(
        _relative_std(first), _relative_std(other)
    )


def _relative_std(cause: CauseResult) -> float:
    """Relative standard deviation of what a cause changes: as of its number, or the surer of a pair in one
    unit, such as a slope's."""
    numbers = list(cause.parameters.values())
    leading = [each for each in numbers if each.unit == numbers[0].unit and each.std > 0.0]
    away = max((abs(each.value - each.nominal) / each.std for each in leading), default=math.inf)
    return math.hypot(FORM_ERROR, 1.0 / max(away, 1e-9))
