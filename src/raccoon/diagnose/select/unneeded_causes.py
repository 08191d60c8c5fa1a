"""Check at the end of a search whether each cause is still needed."""

from __future__ import annotations

from collections.abc import Iterable

from raccoon.diagnose.fit.backlash_scan import active_backlash
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select.fit_comparison import nested_lead
from raccoon.diagnose.select.search import required_evidence
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.transitions import refit_current

MAX_DOUBTED_EXCESS = 25.0
"""Log evidence beyond the required one up to which a cause is checked."""
START_SCALES = ((1.0, 1.0), (1.0, 0.9), (0.5, 1.0))
"""Factors on the base coordinates and the other causes' coordinates at the starts of fits without a cause."""


def find_unneeded_cause(search: Search) -> tuple[str, Fit] | None:
    """The cause of a finished search that falls furthest short of the evidence it needs, and the fit without
    it; None if all are needed.

    With backlash the misfit is rough, and a fit gets stuck before it has converged. A cause that moves it on
    by chance has evidence as long as the fit without it is stuck: beside backlash and a latency of 34 ms a
    slip of 0.3 ms led by 20, and by 7 once the others had been fitted from other starts.
    """
    point, problem, whitener = search.fit.point, search.problem, search.whitener
    if not active_backlash(point):
        return None
    required = {each: required_evidence(search, each, len(point.active) == 1) for each in point.active}
    checked = [
        name
        for name, needed in required.items()
        if search.leads.get(name, needed) - needed < MAX_DOUBTED_EXCESS
    ]
    if not checked:
        return None

    def best(starts: Iterable[Point]) -> Fit:
        return min((fit_point(problem, whitener, start) for start in starts), key=lambda fit: fit.cost)

    current = refit_current(search)
    current = best([current.point, current.point.shrunk(0.5)])
    without = {
        name: best(point.without_cause(name).shrunk(*parts) for parts in START_SCALES) for name in checked
    }
    deficits = {name: required[name] - nested_lead(problem, current, fit) for name, fit in without.items()}
    weakest = max(deficits, key=lambda name: deficits[name])
    return (weakest, without[weakest]) if deficits[weakest] > 0.0 else None
