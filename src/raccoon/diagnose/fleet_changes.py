"""A number over many recordings in their order: did it stay, jump (a new part) or creep (an ageing one)?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

Array = NDArray[np.float64]

FEWEST = 5
LEAST_SIDE = 2
CLEAR_STEP = 6.0
"""Deviations of the difference of the two means. The best of all places is taken, so it must be more than the
usual 3."""
CLEAR_TREND = 5.0
CHANCE = 0.005
"""Share of steady series that may seem to jump, and as many to creep. A deviation that is learnt from five
numbers is often far too small, so they must be further apart than the deviations above."""
FEWEST_BESIDE_ODD = 7
"""Numbers from which one that is far from all others may be left out."""
CLEAR_BESIDE_ODD = 10.0
"""Deviations by which the others must then jump. Of 11 kinds of steady series, 1000 each, none was said to
change that was not before."""
ODD = 6.0
"""Spreads that such a number is at least away from both sides."""


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
        return _beside_odd(known, y, s)
    if step is None:
        return None if trend is None else trend[0]
    return trend[0] if trend is not None and trend[1] < step[2] else _stepped(known, y, step[1])


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


def _stepped(known: NDArray[np.intp], y: Array, place: int) -> Change:
    return Change(Form.STEP, int(known[place]), float(y[:place].mean()), float(y[place:].mean()))


def _beside_odd(known: NDArray[np.intp], y: Array, s: Array) -> Change | None:
    """A step that one number hides which is far from both of its sides, as a run with something else wrong
    is."""
    best: tuple[float, Change] | None = None
    for odd in range(len(y) if len(y) >= FEWEST_BESIDE_ODD else 0):
        others = np.delete(np.arange(len(y)), odd)
        step = _step(y[others], s[others], CLEAR_BESIDE_ODD, len(y))
        if step is None:
            continue
        score, place, spread = step
        change = _stepped(known[others], y[others], place)
        away = min(abs(float(y[odd]) - each) for each in (change.before, change.after))
        if away >= ODD * spread and (best is None or score > best[0]):
            best = score, change
    return None if best is None else best[1]


def _step(y: Array, s: Array, clear: float = CLEAR_STEP, ways: int = 1) -> tuple[float, int, float] | None:
    """(deviations of it, first index after it, spread left), None where it is fewer than `clear`, or than
    chance gives. ways: how many such series the one with the most is taken of."""
    best: tuple[float, int, float] | None = None
    places = range(LEAST_SIDE, len(y) - LEAST_SIDE + 1)
    for place in places:
        one, two = y[:place], y[place:]
        before, after = one.mean(), two.mean()
        left = float(((one - before) ** 2).sum() + ((two - after) ** 2).sum())
        spread, freedom = _spread(left, s)
        size = spread * math.sqrt(1.0 / len(one) + 1.0 / len(two))
        score = abs(float(after - before)) / max(size, 1e-300)
        if score < clear or (best is not None and score <= best[0]):
            continue
        if score >= _by_chance(freedom, ways * len(places)):
            best = score, place, spread
    return best


def _trend(y: Array, s: Array) -> tuple[Change, float] | None:
    x = np.arange(len(y)) - 0.5 * (len(y) - 1)
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    spread, freedom = _spread(float((left**2).sum()), s)
    clear = max(CLEAR_TREND, _by_chance(freedom, 1))
    if abs(slope) * math.sqrt(float(x @ x)) < clear * spread:
        return None
    ends = [float(y.mean() + slope * each) for each in (x[0], x[-1])]
    return Change(Form.TREND, 0, ends[0], ends[1]), spread


def _spread(left: float, s: Array) -> tuple[float, float]:
    """The deviation of one number by the squares that two fitted ones leave and by its own, and the degrees
    of freedom with which it is known: what a diagnosis says of its numbers counts as known (Satterthwaite
    1946)."""
    more = len(s) - 2
    scatter, own = left / more, float((s**2).mean())
    whole = scatter + own
    return math.sqrt(whole), more * (whole / scatter) ** 2 if scatter > 0.0 else math.inf


def _by_chance(freedom: float, ways: int) -> float:
    """Deviations that the most of so many tests of a steady series exceeds with `CHANCE`."""
    return float(stdtrit(min(freedom, 1e6), 1.0 - 0.5 * CHANCE / ways))
