"""Detects saturated readings, which stay at the sensor's largest value."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]

MIN_SAMPLES = 50
"""Least number of samples of a reading that is checked."""
MIN_SATURATED_SHARE = 0.1
"""Share of the samples at exactly the largest value above which a reading is saturated."""
MIN_DROPPED_SHARE = 0.005
"""Share of the samples at +- the largest value above which these samples are left out."""
APPROACH_FRACTION, NEAR_FRACTION, MIN_SETTLING_SHARE = 0.5, 0.98, 0.25
"""Shares of the largest value above which samples count as the approach to it, and as near it; and least
share of the approach that a settling motion is near it. A saturated reading passes through quickly; a motion
that settles is near for a third of the approach and longer, also without noise."""
MIN_NEIGHBOUR_LEVEL_SHARE = 0.25
"""Ratio of the samples at the next inner level to those at the outermost one, above which the outermost is an
ordinary quantisation level and no saturation."""


def saturation_fault(name: str, role: str, values: Array) -> SensorFault | None:
    """The fault of a saturated reading, None for other readings."""
    known = _merge_rounding_errors(values[np.isfinite(values)])
    if role == "battery" or len(known) < MIN_SAMPLES or not np.ptp(known) > 0.0:
        return None
    share_at_ends = _share_at_both_ends(known)
    if share_at_ends > MIN_SATURATED_SHARE:
        where = f"+-{known.max():g} in {100 * share_at_ends:.0f} % of its samples"
        text = f"{name} stays at {where}: it is cut off there"
        return SensorFault(name, "saturated", text)
    for edge in (float(known.max()), float(known.min())):
        share = float((known == edge).mean())
        inside = known[known != edge]
        beside = float(inside.max() if edge == known.max() else inside.min())
        # A reading of 0 at rest is not saturated.
        stays = share > MIN_SATURATED_SHARE and not _is_quantisation_step(share, known, beside)
        if (
            stays
            and abs(edge) > 0.5 * float(np.abs(known).max())
            and not _settles_at_maximum(known * np.sign(edge))
        ):
            text = f"{name} stays at {edge:g} in {100 * share:.0f} % of its samples: it is cut off there"
            return SensorFault(name, "saturated", text)
    return None


def _merge_rounding_errors(values: Array) -> Array:
    """The readings with values that differ only by rounding errors (such as ticks over a row's seconds) made
    equal."""
    size = float(np.nanmax(np.abs(values), initial=0.0))
    return np.asarray(np.round(values / size, 9) * size, float) if size > 0.0 else values


def _share_at_both_ends(known: Array) -> float:
    """Share of the samples at +- the largest value if the reading is saturated in both directions; else 0."""
    size = np.abs(known)
    if len(known) < MIN_SAMPLES or known.max() != -known.min() or _settles_at_maximum(size):
        return 0.0
    share, inside = float((size == size.max()).mean()), size[size < size.max()]
    return 0.0 if len(inside) and _is_quantisation_step(share, size, float(inside.max())) else share


def _is_quantisation_step(share: float, values: Array, beside: float) -> bool:
    """Whether an outermost value is one of several quantisation levels (few ticks per row): the next inner
    level is about as frequent, while a saturated reading only passes it.

    share: of the samples at the outermost value. beside: the next inner level.
    """
    return float((values == beside).mean()) >= MIN_NEIGHBOUR_LEVEL_SHARE * share


def _settles_at_maximum(values: Array) -> bool:
    """Whether a reading approaches its largest value like a motion that settles there.

    For a coarse reading the next inner level counts as near at any distance. Samples at the largest value are
    not part of the approach: noise makes a saturated reading leave it for a sample now and then.
    """
    top = float(values.max())
    beside = float(np.max(values[values < top], initial=-np.inf))
    at, rows = values == top, np.arange(len(values))
    comes = np.flatnonzero(at & ~np.append(False, at[:-1]))
    inside = np.append(0, np.cumsum(~at))

    def inside_from(lower: float) -> int:
        below = np.maximum.accumulate(np.where(values < lower, rows, -1))[comes]
        return int((inside[comes] - inside[below + 1]).sum())

    return inside_from(min(NEAR_FRACTION * top, beside)) > MIN_SETTLING_SHARE * inside_from(
        APPROACH_FRACTION * top
    )


def without_saturated_samples(name: str, values: Array) -> tuple[Array, list[SensorFault]]:
    """The reading without its few samples at +- the largest value, and their fault."""
    steps = _merge_rounding_errors(values)
    share = _share_at_both_ends(steps[np.isfinite(steps)])
    if not MIN_DROPPED_SHARE < share <= MIN_SATURATED_SHARE:
        return values, []
    edge = float(np.nanmax(steps))
    text = f"{name} is cut off at +-{edge:g} in {100 * share:.0f} % of its samples: left out there"
    return np.where(np.abs(steps) == edge, np.nan, values), [SensorFault(name, "cut", text)]
