"""What readings must be before anybody looks for surfaces in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raccoon.core.errors import ConfigError
from raccoon.estimate.tophat.calibration import FULL_SCALE, TophatCalibration, Verdict

Array = NDArray[np.float64]

LEAST_READINGS = 40  # 0.2 s at 200 Hz
RAIL = 4.0  # counts from an end of the converter within which a reading stands at it
MOST_AT_RAIL = 0.9
WANDERING = 250.0  # counts between successive readings: no floor under a sensor does that


def checked(samples: ArrayLike) -> Array:
    """The samples as floats, shape (n,).

    Raises ConfigError naming the first reading that is not a 12-bit count, or the shape that is not 1-D.
    """
    try:
        counts = np.asarray(samples, dtype=float)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"samples are not numbers: {error}") from None
    if counts.ndim != 1:
        raise ConfigError(f"samples have the shape {counts.shape}: allowed is one dimension")
    wrong = ~((counts >= 0.0) & (counts <= FULL_SCALE))  # also true for NaN
    if wrong.any():
        at = int(np.argmax(wrong))
        raise ConfigError(f"samples[{at}] = {counts[at]}: allowed are counts from 0 to {FULL_SCALE:.0f}")
    return counts


def refusal(counts: Array) -> TophatCalibration | None:
    """A verdict that needs no search, or None."""
    if len(counts) < LEAST_READINGS:
        return TophatCalibration(
            Verdict.TOO_FEW, f"{len(counts)} readings; at least {LEAST_READINGS} are needed"
        )
    for rail, name in ((0.0, "bottom (too much light)"), (FULL_SCALE, "top (no light, or unplugged)")):
        share = float(np.mean(np.abs(counts - rail) <= RAIL))
        if share >= MOST_AT_RAIL:
            return TophatCalibration(
                Verdict.SATURATED, f"{share:.0%} of the readings stand at the converter's {name}"
            )
    return None


def wanders(counts: Array) -> bool:
    """True where readings jump about as an open input does. Ask only where no two surfaces were found."""
    return float(np.median(np.abs(np.diff(counts)))) > WANDERING
