"""Numbers of a report as text."""

from __future__ import annotations

import math

from raccoon.diagnose.result import ParameterResult

MAX_PLACES = 6
"""Places on either side of the point that a number has at most; beyond it stands a power of ten."""


def parameter_text(each: ParameterResult) -> str:
    """Value, standard deviation and unit of a parameter."""
    return value_with_std_text(each.value, each.std, each.unit)


def value_with_std_text(value: float, std: float, unit: str = "") -> str:
    """The same of a number that is no result of a diagnosis."""
    sure = f" +- {format_std(std)}" if std != 0.0 else ""  # a count has none
    return f"{format_value(value, std)}{sure} {unit}".rstrip()


def format_two_digits(number: float) -> str:
    """Two digits that count, of a large number as well: 0.0035, 1.2, 99, 600, never 6e+02."""
    return f"{float(f'{number:.2g}'):g}"


def format_std(std: float) -> str:
    """A standard deviation by two digits, zeros too: 0.0010, 0.35, 12."""
    places = _places(std)
    return format_two_digits(std) if places is None else _rounded(std, places)


def format_value(value: float, std: float) -> str:
    """A number with the places of its deviation; where that has none, or both are tiny, with four digits."""
    places = _places(std)
    return f"{value:.4g}" if places is None or not math.isfinite(value) else _rounded(value, places)


def _rounded(number: float, places: int) -> str:
    return f"{round(number, places) + 0.0:.{max(places, 0)}f}"  # and never -0


def _places(std: float) -> int | None:
    """Places behind the point that two digits of a deviation take, below 0 those before it; None where that
    is no way to write it."""
    if not (math.isfinite(std) and std > 0.0):
        return None
    places = 1 - math.floor(math.log10(float(f"{std:.1e}")))
    return places if abs(places) <= MAX_PLACES else None
