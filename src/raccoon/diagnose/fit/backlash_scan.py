"""Fits of gears with play: from the best places around where a fit stops, since the misfit there is a
staircase."""

from __future__ import annotations

from itertools import product

import numpy as np

from raccoon.diagnose.drives.features import BIN_S
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import costs_at, fit_point, fit_starts
from raccoon.diagnose.fit.levenberg_marquardt import CONVERGED_DECREASE, ROUGH_DECREASE
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.whitener import WhiteningMap

BACKLASH = "drive.backlash"
SCAN_SIZES = (-0.16, -0.08, -0.04, -0.02, 0.0, 0.02, 0.04, 0.08, 0.16)
"""Parts of its first coordinate by which the scan of a staircase changes it."""
SCAN_SHAPES = (-0.6, -0.4, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.4, 0.6)
"""By how much it changes the second."""
MIN_SCAN_SIZE = 0.05
"""Size of the first coordinate below which changes grow no smaller."""
WIDE_SIZES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.2, 1.5)
WIDE_SHAPES = (-0.6, 0.0, 0.6)
"""Where play is looked for that is not on: these sizes in the usual bins, and more between them in shorter
ones. How far the valley reaches to either side is how far a wheel turns in a bin."""
MIN_HALF_COST_SAVED = 10.0
"""Half of the cost that such a place must save as it is, with nothing fitted. Of clean robots none saves
anything, and of 0.07 rad of play in a drive that seldom reverses the best saved 265, where those a quarter
larger or smaller cost 20 and 90 more than none."""
SCAN_STARTS = 3
"""Best places of a scan from which everything is fitted."""
MAX_SCANS = 4
"""Most scans of one play, each from the best of the last."""


def active_backlash(point: Point) -> list[str]:
    """The play that is on, of either wheel or both."""
    return [each for each in point.active if each.partition("@")[0] == BACKLASH]


def fit_with_backlash_scan(
    problem: Problem, whitener: WhiteningMap, start: Point | Fit, last: bool = False
) -> Fit:
    """`fit_point`; where gears have play, again from the best places around, until none is better.

    Seen closely the misfit over the gap and over the coasting in it is a staircase, as a tooth is met before
    or after a sample of the gyro, and a fit stops on a stair. last: whether numbers are said of this fit;
    on the way to a set of causes half of a log evidence is not worth another scan.
    """
    fit, least = fit_point(problem, whitener, start), CONVERGED_DECREASE if last else ROUGH_DECREASE
    for name in active_backlash(fit.point):
        for _ in range(MAX_SCANS):
            around = _best_around(problem, whitener, fit, name)
            fits = fit_starts(problem, whitener, around, 8)
            before, fit = fit.cost, min([fit, *fits], key=lambda each: each.cost)
            if fit.cost > before - least:
                break
    return fit


def find_backlash_starts(problem: Problem, whitener: WhiteningMap, fit: Fit) -> list[Point]:
    """The best few places of play of both wheels, where it is off, that explain more than its absence with
    all else held. The valley is narrow, and the columns of no play do not lead into it."""
    between = max(round(BIN_S / problem.features.width), 1)
    every = np.arange(between * (len(WIDE_SIZES) - 1) + 1) / between
    sizes = np.interp(every, np.arange(len(WIDE_SIZES)), WIDE_SIZES)
    starts = [fit.point.with_cause(BACKLASH, np.array(each)) for each in product(sizes, WIDE_SHAPES)]
    found = costs_at(problem, whitener, starts)
    best = np.argsort(found)[:SCAN_STARTS]
    return [starts[each] for each in best if found[each] < fit.cost - 2.0 * MIN_HALF_COST_SAVED]


def _best_around(problem: Problem, whitener: WhiteningMap, fit: Fit, name: str) -> list[Point]:
    """The best few of a grid over both coordinates of a cause around a fit, all others held; where it stands
    itself among them is left out, since a fit from there has been."""
    vector, first = fit.point.vector(), fit.point.spans()[name].start
    size = max(abs(float(vector[first])), MIN_SCAN_SIZE)
    grid = np.repeat(vector[None], len(SCAN_SIZES) * len(SCAN_SHAPES), axis=0)
    grid[:, first] += size * np.repeat(SCAN_SIZES, len(SCAN_SHAPES))
    grid[:, first + 1] += np.tile(SCAN_SHAPES, len(SCAN_SIZES))
    grid = np.clip(grid, *problem.limits(fit.point))
    points = [fit.point.moved(each) for each in grid]
    best = np.argsort(costs_at(problem, whitener, points))[:SCAN_STARTS]
    return [points[each] for each in best if not np.array_equal(grid[each], vector)]
