"""Which causes may well change as much as the one that is named first: no order is surer than its sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.diagnose.result import CauseResult

FORM_ERROR = 0.1
"""Part by which what a cause changes is off however sure its number is, as no form is quite the robot's: of
causes alone it was said 0.92 to 1.33 times what it was, one in ten beyond either."""
MIN_SEPARATION_STDS = 1.5
"""Deviations of the quotient of two causes' changes from which the larger one is: the other one is, by
chance, one time in fifteen."""


def causes_of_similar_size(causes: Sequence[CauseResult]) -> tuple[CauseResult, ...]:
    """Those behind the first that may change as much as it does; none where that does not matter itself, or
    where no drive was recorded. causes: in their order."""
    if not causes or causes[0].little or not causes[0].unabsorbed > 0.0:
        return ()
    return tuple(
        each
        for each in causes[1:]
        if not each.little and _separation_stds(causes[0], each) < MIN_SEPARATION_STDS
    )


def similar_size_text(cause: CauseResult, causes: Sequence[CauseResult]) -> str:
    """The same in words, for the first of these causes; "" for the others, and where it is none."""
    names = [each.name for each in causes_of_similar_size(causes)] if cause.rank == 1 else []
    return f"about as much as {' and '.join(names)}" if names else ""


def _separation_stds(first: CauseResult, other: CauseResult) -> float:
    """By how many of its deviations the logarithm of their changes' quotient is above 0."""
    if not other.unabsorbed > 0.0:
        return math.inf
    return math.log(first.unabsorbed / other.unabsorbed) / math.hypot(
        _relative_std(first), _relative_std(other)
    )


def _relative_std(cause: CauseResult) -> float:
    """The part by which what a cause changes may be off, one deviation: as its number, or the surer of a pair
    in one unit, such as a slope's."""
    numbers = list(cause.parameters.values())
    leading = [each for each in numbers if each.unit == numbers[0].unit and each.std > 0.0]
    away = max((abs(each.value - each.nominal) / each.std for each in leading), default=math.inf)
    return math.hypot(FORM_ERROR, 1.0 / max(away, 1e-9))
