"""Change points of a parameter over recordings in their order: constant, jumping (a new part) or drifting
(ageing).

The model is piecewise constant, or piecewise linear with one common slope. Jumps and the slope are added
while they are significant, corrected for the number of alternatives that were tried.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri, stdtrit

Array = NDArray[np.float64]

MIN_NUMBERS = 5
"""Least length of a series that is searched for a change: a jump then leaves `MIN_DEGREES_OF_FREEDOM`."""
MIN_PIECE_LENGTH = 2
"""Shortest piece, in values."""
MAX_JUMPS = 3
"""Largest number of jumps in one series."""
MIN_DEGREES_OF_FREEDOM = 3
"""Least number of degrees of freedom, from which the scatter is estimated."""
MIN_JUMP_STDS = 6.0
"""Least jump, in standard deviations of the difference of the two means. The best of all places is chosen, so
it must be more than the usual 3."""
MIN_TREND_STDS = 5.0
"""Least slope of a drift, in standard deviations of the slope."""
FALSE_ALARM_SHARE = 0.005
"""Share of constant series that may be reported to jump (false alarms); the same for a drift, and for two
changes at once. A standard deviation estimated from five values is often far too small, so this can require
more than the thresholds above."""
MIN_NUMBERS_WITH_OUTLIER = 7
"""Least length of a series of which one outlier may be left out."""
MIN_JUMP_STDS_WITH_OUTLIER = 10.0
"""Least jump of the other values, in standard deviations of the difference of the two means. With it, none of
11 kinds of constant series, 1000 each, was reported to change in addition to those that were before."""
MIN_OUTLIER_STDS = 6.0
"""Least distance of the outlier from the values on both sides of the jump, in standard deviations of a single
value."""
MIN_RELATIVE_STD = 1e-6
"""Lower bound of a value's standard deviation, relative to the largest value of its series: values that agree
to the last digit differ by rounding errors, which is no jump."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of a series between two jumps. first, last: rows of the series. start, end: fitted values at
    these rows, equal if it is constant."""

    first: int
    last: int
    start: float
    end: float

    @property
    def creeps(self) -> bool:
        """Whether the value drifts from recording to recording."""
        return self.start != self.end


def fit_pieces(values: Sequence[float], stds: Sequence[float]) -> tuple[Piece, ...]:
    """Fit the pieces of a series; () if it is constant within its scatter. NaN values are left out; a NaN std
    is unknown and counts as 0."""
    series, known_stds = np.asarray(values, float), np.asarray(stds, float)
    known = np.flatnonzero(np.isfinite(series))
    if len(known) < MIN_NUMBERS:
        return ()
    y = series[known]
    s = np.maximum(np.nan_to_num(known_stds[known]), MIN_RELATIVE_STD * np.abs(y).max())
    form = _select_form(y, s)
    if form == STEADY:
        return _find_jump_beside_outlier(known, y, s)
    return _make_pieces(form, known, y)


def typical_values(
    rows: NDArray[np.intp], values: Array, known: NDArray[np.intp], course: Sequence[Piece]
) -> Array:
    """The typical value at each of these rows of the series, without scatter: the median of its piece, or its
    line if it drifts. known: rows of the series that have a value."""
    found = np.full(len(values), np.median(values))
    for piece in course:
        inside = (rows >= piece.first) & (rows <= piece.last)
        if piece.creeps:
            ends = np.searchsorted(known, (piece.first, piece.last))
            share = (np.searchsorted(known, rows[inside]) - ends[0]) / max(ends[1] - ends[0], 1)
            found[inside] = piece.start + (piece.end - piece.start) * share
        elif inside.any():
            found[inside] = np.median(values[inside])
    return found


@dataclass(frozen=True, slots=True)
class _Form:
    """The form of a series: whether it drifts, and the index of the first value after each jump."""

    creeps: bool = False
    jumps: tuple[int, ...] = ()

    @property
    def numbers(self) -> int:
        """Number of parameters in addition to the level."""
        return self.creeps + len(self.jumps)

    def bounds(self, count: int) -> Iterator[tuple[int, int]]:
        """Begin and end (exclusive) of each piece of a series of this length."""
        return pairwise((0, *self.jumps, count))

    def simpler_forms(self) -> Iterator[tuple[_Form, float]]:
        """Each form with one parameter less, and the least significance of that parameter in standard
        deviations."""
        if self.creeps:
            yield _Form(False, self.jumps), MIN_TREND_STDS
        for each in self.jumps:
            yield _Form(self.creeps, tuple(it for it in self.jumps if it != each)), MIN_JUMP_STDS

    def larger_forms(self, count: int, add: int) -> Iterator[_Form]:
        """The forms with `add` more parameters for a series of length `count`."""
        free = [at for at in range(1, count) if at not in self.jumps]
        for creeps in {self.creeps, True}:
            jumps = add - (creeps and not self.creeps)
            for places in combinations(free, jumps) if jumps + len(self.jumps) <= MAX_JUMPS else ():
                form = _Form(creeps, tuple(sorted((*self.jumps, *places))))
                if all(end - begin >= MIN_PIECE_LENGTH for begin, end in form.bounds(count)):
                    yield form


STEADY = _Form()


def _select_form(y: Array, s: Array) -> _Form:
    """Forward selection of a series' form: one parameter at a time, or two together if no single one is
    significant."""
    form, sums = STEADY, _cumulative_sums(y)
    while True:
        for add in (1, 2):
            better = _find_better_form(form, add, sums, s)
            if better is not None:
                form = better
                break
        else:
            return form


def _find_better_form(form: _Form, add: int, sums: Array, s: Array) -> _Form | None:
    """The form with `add` more parameters and the least residual among those whose parameters are all
    significant; None if chance explains its gain. sums: from `_cumulative_sums`. s: standard deviations of
    the values."""
    if len(s) - 1 - form.numbers - add < MIN_DEGREES_OF_FREEDOM:
        return None
    before = _residual_squares(form, sums)
    every = {each: _residual_squares(each, sums) for each in form.larger_forms(len(s), add)}
    clear = [each for each in every if _is_clear(each, every[each], sums, s)]
    if not clear:
        return None
    best = min(clear, key=every.__getitem__)
    spread, freedom = _residual_std(every[best], s, best.numbers)
    ways = sum(each.creeps == best.creeps for each in every)
    gained = max(before - every[best], 0.0) / (add * max(spread**2, 1e-300))
    return best if gained >= _gain_by_chance(freedom, add, ways) else None


def _is_clear(form: _Form, left: float, sums: Array, s: Array) -> bool:
    spread, _ = _residual_std(left, s, form.numbers)
    return all(
        _residual_squares(less, sums) - left >= (clear * max(spread, 1e-300)) ** 2
        for less, clear in form.simpler_forms()
    )


def _cumulative_sums(y: Array) -> Array:
    """Cumulative sums (6, count + 1) of 1, x, y, x x, x y and y y, from which any piece is fitted at once."""
    x, z = np.arange(len(y)) - 0.5 * (len(y) - 1), y - y.mean()
    rows = np.array([np.ones(len(y)), x, z, x * x, x * z, z * z])
    return np.concatenate((np.zeros((6, 1)), np.cumsum(rows, axis=1)), axis=1)


def _residual_squares(form: _Form, sums: Array) -> float:
    """Residual sum of squares of a form."""
    _, rest, drop = _fit_trend(form, sums)
    return max(rest - drop, 0.0)


def _fit_trend(form: _Form, sums: Array) -> tuple[float, float, float]:
    """(slope, residual sum of squares with levels only, its drop by the slope), by least squares."""
    xx = xy = yy = 0.0
    for begin, end in form.bounds(sums.shape[1] - 1):
        n, x, y, x2, xy2, y2 = (sums[:, end] - sums[:, begin]).tolist()
        xx, xy, yy = xx + x2 - x * x / n, xy + xy2 - x * y / n, yy + y2 - y * y / n
    return (xy / xx, yy, xy * xy / xx) if form.creeps else (0.0, yy, 0.0)


def _make_pieces(form: _Form, known: NDArray[np.intp], y: Array) -> tuple[Piece, ...]:
    rate = _fit_trend(form, _cumulative_sums(y))[0]
    found = []
    for begin, end in form.bounds(len(y)):
        middle, half = float(y[begin:end].mean()), 0.5 * rate * (end - 1 - begin)
        found.append(Piece(int(known[begin]), int(known[end - 1]), middle - half, middle + half))
    return tuple(found)


def _find_jump_beside_outlier(known: NDArray[np.intp], y: Array, s: Array) -> tuple[Piece, ...]:
    """A jump that is hidden by one outlier, far from the values on both sides, as from a run with another
    fault."""
    best: tuple[float, tuple[Piece, ...]] = 0.0, ()
    for odd in range(len(y) if len(y) >= MIN_NUMBERS_WITH_OUTLIER else 0):
        others = np.delete(np.arange(len(y)), odd)
        sums = _cumulative_sums(y[others])
        forms = [_Form(False, (at,)) for at in range(MIN_PIECE_LENGTH, len(others) - MIN_PIECE_LENGTH + 1)]
        form = min(forms, key=lambda each: _residual_squares(each, sums))
        spread, freedom = _residual_std(_residual_squares(form, sums), s[others], 1)
        gained = (_residual_squares(STEADY, sums) - _residual_squares(form, sums)) / max(spread**2, 1e-300)
        least = max(MIN_JUMP_STDS_WITH_OUTLIER**2, _gain_by_chance(freedom, 1, len(y) * len(forms)))
        pieces = _make_pieces(form, known[others], y[others])
        away = min(abs(float(y[odd]) - each.start) for each in pieces)
        if gained >= max(least, best[0]) and away >= MIN_OUTLIER_STDS * spread:
            best = gained, pieces
    return best[1]


def _residual_std(left: float, s: Array, numbers: int) -> tuple[float, float]:
    """Standard deviation of a single value, and its degrees of freedom. It combines the scatter, from the
    residual sum of squares `left` of a level and `numbers` more parameters, and the values' own standard
    deviations s, which count as known exactly (Satterthwaite 1946)."""
    more = len(s) - 1 - numbers
    scatter, own = left / more, float((s**2).mean())
    whole = scatter + own
    return math.sqrt(whole), more * (whole / scatter) ** 2 if scatter > 0.0 else math.inf


def _gain_by_chance(freedom: float, numbers: int, ways: int) -> float:
    """Gain per parameter, in squared standard deviations, that the best of `ways` alternatives reaches by
    chance in `FALSE_ALARM_SHARE` of constant series: Student's t squared for one parameter, Fisher's F for
    two."""
    chance = FALSE_ALARM_SHARE / (ways * numbers)
    if numbers == 1:
        return float(stdtrit(min(freedom, 1e6), 1.0 - 0.5 * chance)) ** 2
    return float(fdtri(numbers, min(freedom, 1e6), 1.0 - chance))
