"""Numbers of a report as text."""

from __future__ import annotations

import math

from raccoon.diagnose.result import ParameterResult


def number_text(each: ParameterResult) -> str:
    """Value, deviation and unit."""
    return f"{with_deviation(each.value, each.std)} +- {two_digits(each.std)} {each.unit}".rstrip()


def two_digits(number: float) -> str:
    """Two digits that count, of a large number as well: 0.0035, 1.2, 99, 600, never 6e+02."""
    return f"{number:.2g}" if not math.isfinite(number) else f"{float(f'{number:.2g}'):.6g}"


def with_deviation(value: float, std: float) -> str:
    """A number with as many digits as its deviation has, at least four."""
    if not (math.isfinite(std) and std > 0.0 and math.isfinite(value) and value != 0.0):
        return f"{value:.4g}"
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2
    return f"{value:.{min(max(digits, 4), 9)}g}"
