from __future__ import annotations

import math

import pytest

from raccoon.diagnose.reports.numbers import format_two_digits, parameter_text
from raccoon.diagnose.result import ParameterResult


@pytest.mark.parametrize(
    ("value", "std", "said"),
    [
        (1.0, 0.001, "1.0000 +- 0.0010"),
        (-0.1876, 0.18, "-0.19 +- 0.18"),
        (0.007096, 0.00049, "0.00710 +- 0.00049"),
        (0.0, 0.0996, "0.00 +- 0.10"),
        (-0.0004, 0.013, "0.000 +- 0.013"),
        (1.23, 13.0, "1 +- 13"),
        (-968.7, 602.0, "-970 +- 600"),
        (7.69e-5, 3.1e-6, "7.69e-05 +- 3.1e-06"),
        (0.3878, 0.0, "0.3878"),
        (1.0, math.nan, "1 +- nan"),
    ],
)
def test_a_number_has_the_places_that_its_deviation_has(value: float, std: float, said: str) -> None:
    """A scale of 1 +- 0.001 is known to three places, an offset of -0.1876 +- 0.18 not to four."""
    assert parameter_text(ParameterResult(value, std, "V", 0.0)) == f"{said} V"


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (0.00349, "0.0035"),
        (1.234, "1.2"),
        (98.7, "99"),
        (604.0, "600"),
        (-12345.0, "-12000"),
        (math.nan, "nan"),
    ],
)
def test_two_digits_count_without_a_power_of_ten(number: float, said: str) -> None:
    assert format_two_digits(number) == said
