"""The methods that the calibrator is compared with: they find what they are known for."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

from raccoon.core.errors import CalibrationError

sys.path.insert(0, str(Path(__file__).parents[4] / "benchmarks"))
methods = import_module("tophat_methods")


@pytest.mark.parametrize(("name", "threshold"), [("fixed", 1500), ("midpoint", 1000), ("k_means", 1000)])
def test_methods_find_the_middle_of_an_easy_case(name: str, threshold: float) -> None:
    assert methods.METHODS[name]([200.0] * 80 + [1800.0] * 80) == pytest.approx(threshold)


def test_methods_have_the_weakness_they_are_known_for() -> None:
    rare = [200.0] * 190 + [1800.0] * 10
    # 5 % black lies beyond the 90th percentile
    assert methods.METHODS["percentile"](rare) == pytest.approx(200.0)
    assert methods.METHODS["trimmed"]([200.0] * 9 + [1000.0] + [1800.0] * 9) == pytest.approx(1000.0)
    with pytest.raises(CalibrationError, match="contrast 600"):
        methods.METHODS["k_means"]([1000.0] * 50 + [1600.0] * 50)
    with pytest.raises(CalibrationError, match="1 readings"):
        methods.METHODS["midpoint"]([3.0])


def test_running_midpoint_waits_for_variation() -> None:
    running = methods.RunningMidpoint()
    assert running.update(200.0) is None
    assert running.update(1800.0) is True
    assert running.update(250.0) is False
