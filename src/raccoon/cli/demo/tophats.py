"""The paper's eight tophat conditions: calibration on one drive, test on another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from raccoon.estimate.tophat import TophatCalibration, calibrate
from raccoon.model.paper import TOPHAT_READINGS, TophatReading
from raccoon.model.reflectance import drive_over_line

# The peers' library refuses a smaller contrast, so it fails in five of the eight conditions.
REFUSED_CONTRAST = 700


@dataclass(frozen=True, slots=True)
class TophatResult:
    """One condition: its calibration, and the share of a second drive's readings that it misclassifies."""

    condition: TophatReading
    calibration: TophatCalibration
    wrong: float


def tophat_results(seed: int) -> list[TophatResult]:
    """In each condition, calibrate on a 60 cm drive over a 15 mm line, and classify the readings of another
    such drive."""
    results = []
    for number, condition in enumerate(TOPHAT_READINGS):
        rng = np.random.default_rng((seed, number))
        calibration = calibrate(drive_over_line(rng, condition)[0])
        results.append(
            TophatResult(condition, calibration, _misclassified_share(calibration, rng, condition))
        )
    return results


def _misclassified_share(
    calibration: TophatCalibration, rng: np.random.Generator, condition: TophatReading
) -> float:
    if calibration.threshold is None:
        return 1.0
    samples, darkness = drive_over_line(rng, condition)
    clear = (darkness < 0.05) | (darkness > 0.95)  # at an edge both answers are acceptable
    black = samples[clear] > calibration.threshold
    return float(np.mean(black != (darkness[clear] > 0.5)))
