"""Back-EMF readings that are not proportional to the speed, from what a diagnosis leaves on unseen data.

Nothing in the catalogue bends a reading over its speed. A reading that was off by 30 counts in waves over the
speed was reported as stiction, another scale of both readings, a slip and a slope, which were said to explain
it, while 0.8 to 0.9 of the error that they left depended on nothing but the speed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.result import Curve, Diagnosis, Unexplained, Verdict
from raccoon.diagnose.unknown.sensor_probes import hat_functions, without_straight_line

Array = NDArray[np.float64]

BEMF_OVER_SPEED = "back-EMF over speed"
KNOTS, BLOCK_S = 9, 0.5
"""Points of the curve, and the length in s of the parts that are predicted from the others in turns."""
MIN_BINS = 10 * KNOTS
MIN_SHARE, MIN_SIZE = 0.6, 0.012
"""Least share of the remaining error that the curve predicts, and its least size, relative to the standard
deviation of the reading. A straight line over the speed is taken off first: scales and offsets have causes,
and in 230 blind drives what was left of them was up to 0.9 of the error, of a size of up to 0.029."""
SHRINKAGE = 1.0
"""Added to the squares of each point's weights, so that a point near few speeds stays near 0: with 0.001 the
share of that reading was 0.25 instead of 0.93, with the line."""
_VERDICTS = {Verdict.ADEQUATE: Verdict.UNKNOWN, Verdict.EXPLAINED: Verdict.PARTLY}


def with_curved_readings(found: Diagnosis) -> Diagnosis:
    """The diagnosis, with something unknown over the speed if a back-EMF is not proportional to it. If it has
    something unknown already, that may be what bends the readings."""
    sizes = {each.name: size for each in found.curves if (size := _curve_size(each)) > 0.0}
    if not sizes or found.unexplained.depends_on:
        return found
    said = " and ".join(f"{size:.0f} counts ({name})" for name, size in sizes.items())
    note = (
        f"readings deviate from the simulated ones by {said} in a curve over the speed, as by no known cause"
    )
    return replace(
        found,
        verdict=_VERDICTS.get(found.verdict, found.verdict),
        unexplained=Unexplained(found.unexplained.share, (BEMF_OVER_SPEED,)),
        notes=(*found.notes, note),
    )


def _curve_size(curve: Curve) -> float:
    """RMS in counts of the curve over the speed on which the remaining error of a back-EMF depends; 0 if it
    does not."""
    known = np.isfinite(curve.measured) & np.isfinite(curve.after)
    if not curve.name.endswith(".bemf") or known.sum() < MIN_BINS:
        return 0.0
    measured = curve.measured[known]
    (error,) = without_straight_line((measured - curve.after[known])[None], measured)
    hats = hat_functions(measured, KNOTS)
    block = np.floor(curve.time[known] / BLOCK_S) % 2.0
    predicted = np.empty_like(error)
    for part in (0.0, 1.0):
        near, here = hats[:, block != part], block == part
        weights = np.linalg.solve(near @ near.T + SHRINKAGE * np.eye(KNOTS), near @ error[block != part])
        predicted[here] = weights @ hats[:, here]
    size = float(np.sqrt((predicted**2).mean()))
    is_curved = ((error - predicted) ** 2).sum() < (1.0 - MIN_SHARE) * (error**2).sum()
    return size if is_curved and size > MIN_SIZE * float(measured.std()) else 0.0
