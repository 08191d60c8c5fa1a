"""Formats the numbers of a report."""

from __future__ import annotations

import math

from raccoon.diagnose.result import ParameterResult

MAX_PLACES = 6
"""Largest number of decimal places, or of rounded digits before the point."""


def parameter_text(each: ParameterResult) -> str:
    """Value, standard deviation and unit of a parameter."""
    return value_with_std_text(each.value, each.std, each.unit)


def value_with_std_text(value: float, std: float, unit: str = "") -> str:
    """Value, standard deviation (if not 0) and unit as text."""
    sure = f" +- {format_std(std)}" if std != 0.0 else ""  # a count has no standard deviation
    return f"{format_value(value, std)}{sure} {unit}".rstrip()


def format_two_digits(number: float) -> str:
    """Two significant digits, also of a large number: 0.0035, 1.2, 99, 600, never 6e+02."""
    return f"{float(f'{number:.2g}'):g}"


def format_std(std: float) -> str:
    """A standard deviation with two significant digits, including zeros: 0.0010, 0.35, 12."""
    places = _places(std)
    return format_two_digits(std) if places is None else _rounded(std, places)


def format_value(value: float, std: float) -> str:
    """A value with the decimal places of its standard deviation; with four significant digits if it has none
    or it is outside MAX_PLACES."""
    places = _places(std)
    return f"{value:.4g}" if places is None or not math.isfinite(value) else _rounded(value, places)


def _rounded(number: float, places: int) -> str:
    return f"{round(number, places) + 0.0:.{max(places, 0)}f}"  # + 0.0 turns -0 into 0


def _places(std: float) -> int | None:
    """Decimal places for two significant digits of a standard deviation, negative for places before the
    point; None if it is 0, not finite, or outside MAX_PLACES."""
    if not (math.isfinite(std) and std > 0.0):
        return None
    places = 1 - math.floor(math.log10(float(f"{std:.1e}")))
    return places if abs(places) <= MAX_PLACES else None
