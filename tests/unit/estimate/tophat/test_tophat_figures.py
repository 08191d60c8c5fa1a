"""The figures of docs/tophats.md, on few fixed draws of the fitted model; the benchmark prints them all."""

import math

import numpy as np
import pytest

from raccoon.estimate.tophat import Verdict, calibrate
from raccoon.model.paper import TOPHAT_READINGS, TophatReading
from raccoon.model.reflectance import drive_over_line


@pytest.mark.parametrize(
    "condition", TOPHAT_READINGS, ids=lambda each: f"{each.generation}-{each.height}-{each.light}"
)
def test_paper_condition_is_accepted_and_later_readings_are_right(condition: TophatReading) -> None:
    allowed = 0.01 if condition.light == "sun" else 0.001
    for seed in range(3):
        rng = np.random.default_rng(seed)
        first, _ = drive_over_line(rng, condition, noise=rng.uniform(2.0, 5.0))
        later, darkness = drive_over_line(rng, condition, noise=rng.uniform(2.0, 5.0))
        found = calibrate(first)
        assert found.verdict is Verdict.OK
        assert found.threshold is not None
        clear = (darkness <= 0.05) | (darkness >= 0.95)
        wrong = (later >= found.threshold) != (darkness > 0.5)
        assert wrong[clear].mean() <= allowed
        assert wrong.mean() <= 0.01  # edges included


@pytest.mark.parametrize(("share", "times"), [(0.5, 1.2), (0.05, 1.2), (0.01, 3.0)])
def test_threshold_is_nearly_as_good_as_any(share: float, times: float) -> None:
    """Expected error over the Bayes error, at 1200 and 1700 counts and 5.6 standard deviations apart."""
    sd = 250.0 / 2.795
    ratios = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        black = rng.permutation(500) < 500 * share
        found = calibrate(np.where(black, 1700.0, 1200.0) + sd * rng.standard_normal(500))
        if found.verdict is Verdict.OK or share >= 0.05:
            assert found.threshold is not None
            error = 0.5 * (tail((found.threshold - 1200.0) / sd) + tail((1700.0 - found.threshold) / sd))
            ratios.append(error / tail(250.0 / sd))
        else:
            assert found.verdict is Verdict.WEAK
    if ratios:
        assert np.mean(ratios) <= times


def tail(z: float) -> float:
    return 0.5 * math.erfc(z / math.sqrt(2.0))
