"""Fits of backlash, whose misfit is a staircase: restarted from the best points of a grid around a fit."""

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
"""Relative changes of the first coordinate (the angle) on the grid around a fit."""
SCAN_SHAPES = (-0.6, -0.4, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.4, 0.6)
"""Changes of the second coordinate (how far wheels coast) on that grid."""
MIN_SCAN_SIZE = 0.05
"""Lower bound on the size of the first coordinate to which its changes are relative."""
WIDE_SIZES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.2, 1.5)
WIDE_SHAPES = (-0.6, 0.0, 0.6)
"""Grid on which inactive backlash is searched for: these sizes with the usual bins, and more between them
with shorter ones. The valley of the misfit is as wide as a wheel turns in a bin."""
MIN_HALF_COST_SAVED = 10.0
"""Half of the cost that a point of that grid must save while nothing is fitted. On clean robots none saves
anything; with 0.07 rad of backlash in a drive that seldom reverses the best saved 265, and points a quarter
larger or smaller cost 20 and 90 more than no backlash."""
SCAN_STARTS = 3
"""Number of points of a scan, the best ones, from which everything is fitted."""
MAX_SCANS = 4
"""Maximum number of scans of one backlash, each around the best fit of the previous one."""


def active_backlash(point: Point) -> list[str]:
    """Names of the active causes that are backlash, of either wheel or both."""
    return [each for each in point.active if each.partition("@")[0] == BACKLASH]


def fit_with_backlash_scan(
    problem: Problem, whitener: WhiteningMap, start: Point | Fit, last: bool = False
) -> Fit:
    """`fit_point`; with active backlash, repeated from the best points around the fit until none improves it.

    The misfit over the backlash angle and over how far wheels coast in it is a staircase, since a tooth is
    met before or after a gyro sample, and a fit stops on a stair. last: whether this fit's numbers are
    reported; during a search a gain below half a unit of log evidence ends the scans.
    """
    fit, min_decrease = fit_point(problem, whitener, start), CONVERGED_DECREASE if last else ROUGH_DECREASE
    for name in active_backlash(fit.point):
        for _ in range(MAX_SCANS):
            around = _best_around(problem, whitener, fit, name)
            fits = fit_starts(problem, whitener, around, 8)
            previous_cost, fit = fit.cost, min([fit, *fits], key=lambda each: each.cost)
            if fit.cost > previous_cost - min_decrease:
                break
    return fit


def find_backlash_starts(problem: Problem, whitener: WhiteningMap, fit: Fit) -> list[Point]:
    """The best points with inactive backlash of both wheels added that cost clearly less than no backlash,
    everything else fixed. The valley is narrow, and the columns at no backlash do not lead into it."""
    subdivision = max(round(BIN_S / problem.features.width), 1)
    positions = np.arange(subdivision * (len(WIDE_SIZES) - 1) + 1) / subdivision
    sizes = np.interp(positions, np.arange(len(WIDE_SIZES)), WIDE_SIZES)
    starts = [fit.point.with_cause(BACKLASH, np.array(each)) for each in product(sizes, WIDE_SHAPES)]
    costs = costs_at(problem, whitener, starts)
    best = np.argsort(costs)[:SCAN_STARTS]
    return [starts[each] for each in best if costs[each] < fit.cost - 2.0 * MIN_HALF_COST_SAVED]


def _best_around(problem: Problem, whitener: WhiteningMap, fit: Fit, name: str) -> list[Point]:
    """The best points of a grid over both coordinates of a cause around a fit, all others fixed; without the
    fit's own point, which was already a starting point."""
    vector, first = fit.point.vector(), fit.point.spans()[name].start
    size = max(abs(float(vector[first])), MIN_SCAN_SIZE)
    grid = np.repeat(vector[None], len(SCAN_SIZES) * len(SCAN_SHAPES), axis=0)
    grid[:, first] += size * np.repeat(SCAN_SIZES, len(SCAN_SHAPES))
    grid[:, first + 1] += np.tile(SCAN_SHAPES, len(SCAN_SIZES))
    grid = np.clip(grid, *problem.limits(fit.point))
    points = [fit.point.moved(each) for each in grid]
    best = np.argsort(costs_at(problem, whitener, points))[:SCAN_STARTS]
    return [points[each] for each in best if not np.array_equal(grid[each], vector)]
