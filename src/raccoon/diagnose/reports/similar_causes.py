"""Causes that may change the readings as much as the first-ranked one: the ranking is as uncertain as the
sizes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.diagnose.result import CauseResult

FORM_ERROR = 0.1
"""Relative error of a cause's change due to inexact equations, however certain its parameter: on single
causes the estimated change was 0.92 to 1.33 times the true one, with one in ten beyond either limit."""
MIN_SEPARATION_STDS = 1.5
"""Least logarithm of the ratio of two causes' changes, in standard deviations, above which the larger one is
clearly larger (wrong by chance one time in fifteen)."""


def causes_of_similar_size(causes: Sequence[CauseResult]) -> tuple[CauseResult, ...]:
    """Causes ranked after the first that may change as much as it does; none if the first is negligible or
    the recording is no drive. causes: in their order."""
    if not causes or causes[0].is_negligible or not causes[0].unabsorbed > 0.0:
        return ()
    return tuple(
        each
        for each in causes[1:]
        if not each.is_negligible and _separation_stds(causes[0], each) < MIN_SEPARATION_STDS
    )


def similar_size_text(cause: CauseResult, causes: Sequence[CauseResult]) -> str:
    """`causes_of_similar_size` in words, for the first cause; "" for other causes and if there are none."""
    names = [each.name for each in causes_of_similar_size(causes)] if cause.rank == 1 else []
    return f"about as much as {' and '.join(names)}" if names else ""


def _separation_stds(first: CauseResult, other: CauseResult) -> float:
    """Logarithm of the ratio of the changes of two causes, in its standard deviations."""
    if not other.unabsorbed > 0.0:
        return math.inf
    return math.log(first.unabsorbed / other.unabsorbed) / math.hypot(
        _relative_std(first), _relative_std(other)
    )


def _relative_std(cause: CauseResult) -> float:
    """Relative standard deviation of a cause's change: that of its parameter, or of the more certain one of a
    pair with the same unit (as of a slope), and the form error."""
    numbers = list(cause.parameters.values())
    leading = [each for each in numbers if each.unit == numbers[0].unit and each.std > 0.0]
    away = max((abs(each.value - each.nominal) / each.std for each in leading), default=math.inf)
    return math.hypot(FORM_ERROR, 1.0 / max(away, 1e-9))
