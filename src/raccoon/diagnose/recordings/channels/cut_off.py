"""Readings that stay at the largest value that a sensor has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]

FEWEST = 50
"""Samples below which nothing is said of a reading."""
CLIPPED_SHARE = 0.1
"""Share of the samples at exactly the largest value from which a reading is saturated."""
FEW_CUT = 0.005
"""Share of the samples at +- its largest value from which a reading is cut off in a few."""
HALF, NEAR_EDGE, SETTLES = 0.5, 0.98, 0.25
"""Of a largest value: from where the way to it counts, and what is near. What is cut off crosses that on its
way. A motion that settles is near for a third of its way and longer, also where it has no noise."""
BESIDE = 0.25
"""Of the samples at an outermost value, how many the step inside it has where neither is an edge."""


def cut_off(name: str, role: str, values: Array) -> SensorFault | None:
    """A reading that stays at its largest value."""
    known = _in_steps(values[np.isfinite(values)])
    if role == "battery" or len(known) < FEWEST or not np.ptp(known) > 0.0:
        return None
    either = _both_ends(known)
    if either > CLIPPED_SHARE:
        text = (
            f"{name} stays at +-{known.max():g} in {100 * either:.0f} % of its samples: it is cut off there"
        )
        return SensorFault(name, "saturated", text)
    for edge in (float(known.max()), float(known.min())):
        share = float((known == edge).mean())
        inside = known[known != edge]
        beside = float(inside.max() if edge == known.max() else inside.min())
        # 0 at rest is no edge.
        stays = share > CLIPPED_SHARE and not _is_a_step(share, known, beside)
        if stays and abs(edge) > 0.5 * float(np.abs(known).max()) and not _settles(known * np.sign(edge)):
            text = f"{name} stays at {edge:g} in {100 * share:.0f} % of its samples: it is cut off there"
            return SensorFault(name, "saturated", text)
    return None


def _in_steps(values: Array) -> Array:
    """Readings of which those that only arithmetic tells apart are the same: ticks over a row's seconds."""
    size = float(np.nanmax(np.abs(values), initial=0.0))
    return np.asarray(np.round(values / size, 9) * size, float) if size > 0.0 else values


def _both_ends(known: Array) -> float:
    """Share of a reading's samples at its largest value, either way, where it is cut off there; else 0."""
    size = np.abs(known)
    if len(known) < FEWEST or known.max() != -known.min() or _settles(size):
        return 0.0
    share, inside = float((size == size.max()).mean()), size[size < size.max()]
    return 0.0 if len(inside) and _is_a_step(share, size, float(inside.max())) else share


def _is_a_step(share: float, values: Array, beside: float) -> bool:
    """Whether an outermost value is a step of many that are alike, as of few ticks a row: the step inside it
    comes as often, and what is cut off only passes there. share: of the samples at the outermost value."""
    return float((values == beside).mean()) >= BESIDE * share


def _settles(values: Array) -> bool:
    """Whether a reading comes to its largest value as a motion that settles there. Of one in coarse steps the
    step inside it is near, however far that is: nothing lies between. Samples at the value itself are no way
    to it: noise lets what is cut off leave it for one, after long."""
    top = float(values.max())
    beside = float(np.max(values[values < top], initial=-np.inf))
    at, rows = values == top, np.arange(len(values))
    comes = np.flatnonzero(at & ~np.append(False, at[:-1]))
    inside = np.append(0, np.cumsum(~at))

    def inside_from(least: float) -> int:
        below = np.maximum.accumulate(np.where(values < least, rows, -1))[comes]
        return int((inside[comes] - inside[below + 1]).sum())

    return inside_from(min(NEAR_EDGE * top, beside)) > SETTLES * inside_from(HALF * top)


def without_ends(name: str, values: Array) -> tuple[Array, list[SensorFault]]:
    """A reading without the few samples that are cut off, and what is said of them."""
    steps = _in_steps(values)
    share = _both_ends(steps[np.isfinite(steps)])
    if not FEW_CUT < share <= CLIPPED_SHARE:
        return values, []
    edge = float(np.nanmax(steps))
    text = f"{name} is cut off at +-{edge:g} in {100 * share:.0f} % of its samples: left out there"
    return np.where(np.abs(steps) == edge, np.nan, values), [SensorFault(name, "cut", text)]
