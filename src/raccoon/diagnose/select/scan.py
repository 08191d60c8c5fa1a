"""Causes at which readings jump, tried at every size.

A reading that jumps a moment too early is a large error, so the misfit over such a cause's size is full of
holes in which a descent gets stuck. Counted so that no event decides, it is smooth and has its best at the
right size.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit import Fit
from raccoon.diagnose.select.outlook import Search, lead

Array = NDArray[np.float64]

SIZES = np.arange(0.2, 5.01, 0.1)
AROUND = 2
"""Sizes on either side over which the column at a size is taken."""


def scanned(search: Search, name: str) -> Fit:
    """The best size of a cause with one coordinate; all other numbers follow in a straight line."""
    problem = search.problem
    points = [search.fit.point.with_cause(name, np.array([u])) for u in SIZES]
    white = search.whitener(problem.features.measured - problem.predict(points))
    frozen, vector = search.fit.jacobian, search.fit.point.vector()
    pulled = white + vector @ frozen
    means = np.linalg.solve(np.eye(len(frozen)) + frozen @ frozen.T, frozen @ pulled.T).T
    low, high = problem.limits(search.fit.point)
    means = np.clip(means, low, high)
    residuals = pulled - means @ frozen
    fits = []
    for place in range(AROUND, len(SIZES) - AROUND):
        before, after = place - AROUND, place + AROUND
        column = (residuals[before] - residuals[after]) / (SIZES[after] - SIZES[before])
        at = search.fit.point.moved(means[place]).with_cause(name, np.array([SIZES[place]]))
        fits.append(Fit.of(problem, at, residuals[place], np.vstack([frozen, column])))
    return max(fits, key=lambda fit: lead(problem, fit, search.fit))
