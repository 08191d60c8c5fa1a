"""Fits of gears with play: from the best places around where a fit stops, since the misfit there is a
staircase."""

from __future__ import annotations

from itertools import product

import numpy as np

from raccoon.diagnose.drives.features import BIN_S
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import costs_at, fit_afresh, fit_point
from raccoon.diagnose.fit.levenberg_marquardt import ROUGH, SETTLED
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.whitener import Whitening

STAIRS = "drive.backlash"
SCAN_SIZES = (-0.16, -0.08, -0.04, -0.02, 0.0, 0.02, 0.04, 0.08, 0.16)
"""Parts of its first coordinate by which the scan of a staircase changes it."""
SCAN_SHAPES = (-0.6, -0.4, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.4, 0.6)
"""By how much it changes the second."""
LEAST_SCANNED = 0.05
"""Size of the first coordinate below which changes grow no smaller."""
WIDE_SIZES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.2, 1.5)
WIDE_SHAPES = (-0.6, 0.0, 0.6)
"""Where play is looked for that is not on: these sizes in the usual bins, and more between them in shorter
ones. How far the valley reaches to either side is how far a wheel turns in a bin."""
HELPS = 10.0
"""Half of the cost that such a place must save as it is, with nothing fitted. Of clean robots none saves
anything, and of 0.07 rad of play in a drive that seldom reverses the best saved 265, where those a quarter
larger or smaller cost 20 and 90 more than none."""
SCANNED = 3
"""Best places of a scan from which everything is fitted."""
SCANS = 4
"""Most scans of one play, each from the best of the last."""


def play_of(point: Point) -> list[str]:
    """The play that is on, of either wheel or both."""
    return [each for each in point.active if each.partition("@")[0] == STAIRS]


def fit_scanned(problem: Problem, whitener: Whitening, start: Point | Fit, last: bool = False) -> Fit:
    """`fit_point`; where gears have play, again from the best places around, until none is better.

    Seen closely the misfit over the gap and over the coasting in it is a staircase, as a tooth is met before
    or after a sample of the gyro, and a fit stops on a stair. last: whether numbers are said of this fit;
    on the way to a set of causes half of a log evidence is not worth another scan.
    """
    fit, least = fit_point(problem, whitener, start), SETTLED if last else ROUGH
    for name in play_of(fit.point):
        for _ in range(SCANS):
            around = _best_around(problem, whitener, fit, name)
            fits = fit_afresh(problem, whitener, around, 8)
            before, fit = fit.cost, min([fit, *fits], key=lambda each: each.cost)
            if fit.cost > before - least:
                break
    return fit


def places_of_play(problem: Problem, whitener: Whitening, fit: Fit) -> list[Point]:
    """The best few places of play of both wheels, where it is off, that explain more than its absence with
    all else held. The valley is narrow, and the columns of no play do not lead into it."""
    between = max(round(BIN_S / problem.features.width), 1)
    every = np.arange(between * (len(WIDE_SIZES) - 1) + 1) / between
    sizes = np.interp(every, np.arange(len(WIDE_SIZES)), WIDE_SIZES)
    starts = [fit.point.with_cause(STAIRS, np.array(each)) for each in product(sizes, WIDE_SHAPES)]
    found = costs_at(problem, whitener, starts)
    best = np.argsort(found)[:SCANNED]
    return [starts[each] for each in best if found[each] < fit.cost - 2.0 * HELPS]


def _best_around(problem: Problem, whitener: Whitening, fit: Fit, name: str) -> list[Point]:
    """The best few of a grid over both coordinates of a cause around a fit, all others held; where it stands
    itself among them is left out, since a fit from there has been."""
    vector, first = fit.point.vector(), fit.point.spans()[name].start
    size = max(abs(float(vector[first])), LEAST_SCANNED)
    grid = np.repeat(vector[None], len(SCAN_SIZES) * len(SCAN_SHAPES), axis=0)
    grid[:, first] += size * np.repeat(SCAN_SIZES, len(SCAN_SHAPES))
    grid[:, first + 1] += np.tile(SCAN_SHAPES, len(SCAN_SIZES))
    grid = np.clip(grid, *problem.limits(fit.point))
    points = [fit.point.moved(each) for each in grid]
    best = np.argsort(costs_at(problem, whitener, points))[:SCANNED]
    return [points[each] for each in best if not np.array_equal(grid[each], vector)]
