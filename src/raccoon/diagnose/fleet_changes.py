"""A number over many recordings in their order: did it stay, jump (a new part) or creep (an ageing one)?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 5
LEAST_SIDE = 2
CLEAR_STEP = 6.0
"""Deviations of the difference of the two means. The best of all places is taken, so it must be more than the
usual 3."""
CLEAR_TREND = 5.0
BETTER = 1.5
"""How much better than the other form (in the spread that is left) a step or a trend must be."""


class Form(StrEnum):
    """How a number changes from recording to recording."""

    STEP = "step"
    TREND = "trend"


@dataclass(frozen=True, slots=True)
class Change:
    """before, after: the means on both sides of a step, the ends of a trend. first: index of the first
    recording after the step, 0 for a trend."""

    form: Form
    first: int
    before: float
    after: float


def change_of(values: Sequence[float], stds: Sequence[float]) -> Change | None:
    """The change in a series, None where it stays within its spread. NaN values are left out."""
    series, known_stds = np.asarray(values, float), np.asarray(stds, float)
    known = np.flatnonzero(np.isfinite(series))
    if len(known) < FEWEST:
        return None
    y, s = series[known], np.nan_to_num(known_stds[known])
    step, trend = _step(y, s), _trend(y, s)
    if step is None and trend is None:
        return None
    if trend is None or (step is not None and step[1] * BETTER < trend[1]):
        return _stepped(known, y, step)
    if step is None or trend[1] * BETTER < step[1]:
        return trend[0]
    return trend[0] if trend[1] < step[1] else _stepped(known, y, step)


def levels(rows: NDArray[np.intp], values: Array, known: NDArray[np.intp], change: Change | None) -> Array:
    """What each value (of a row of the series) would be without its scatter: the median of all, or of its
    side of a step, or the trend. known: rows of the series that have a value."""
    if change is not None and change.form is Form.TREND:
        share = np.searchsorted(known, rows) / max(len(known) - 1, 1)
        return np.asarray(change.before + (change.after - change.before) * share, float)
    after = rows >= (0 if change is None else change.first)
    found = np.empty(len(values))
    for side in (after, ~after):
        if side.any():
            found[side] = np.median(values[side])
    return found


def _stepped(known: NDArray[np.intp], y: Array, step: tuple[int, float] | None) -> Change | None:
    if step is None:
        return None
    place = step[0]
    return Change(Form.STEP, int(known[place]), float(y[:place].mean()), float(y[place:].mean()))


def _step(y: Array, s: Array) -> tuple[int, float] | None:
    """(first index after it, spread left), None where it is not clear."""
    best: tuple[float, int, float] | None = None
    for place in range(LEAST_SIDE, len(y) - LEAST_SIDE + 1):
        one, two = y[:place], y[place:]
        left = float(((one - one.mean()) ** 2).sum() + ((two - two.mean()) ** 2).sum())
        spread = math.sqrt(left / max(len(y) - 2, 1) + float((s**2).mean()))
        size = spread * math.sqrt(1.0 / len(one) + 1.0 / len(two))
        score = abs(float(two.mean() - one.mean())) / max(size, 1e-300)
        if best is None or score > best[0]:
            best = score, place, spread
    return None if best is None or best[0] < CLEAR_STEP else best[1:]


def _trend(y: Array, s: Array) -> tuple[Change, float] | None:
    x = np.arange(len(y)) - 0.5 * (len(y) - 1)
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    spread = math.sqrt(float((left**2).sum()) / max(len(y) - 2, 1) + float((s**2).mean()))
    if abs(slope) * math.sqrt(float(x @ x)) < CLEAR_TREND * spread:
        return None
    ends = [float(y.mean() + slope * each) for each in (x[0], x[-1])]
    return Change(Form.TREND, 0, ends[0], ends[1]), spread
