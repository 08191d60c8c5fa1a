"""Whether each cause is needed, asked once more when the search is over."""

from __future__ import annotations

from dataclasses import replace

from raccoon.diagnose.fit import fit_point
from raccoon.diagnose.fit_scan import play_of
from raccoon.diagnose.fitted import Fit
from raccoon.diagnose.problem import Point
from raccoon.diagnose.select.moves import BETTER_TOGETHER, settled_fit
from raccoon.diagnose.select.outlook import Search, estimated, lead
from raccoon.diagnose.select.search import pruned, required_evidence

DOUBT = 25.0
"""Log evidence beyond what it must have up to which a cause is asked again."""
STARTS = ((1.0, 1.0), (1.0, 0.9), (0.5, 1.0))
"""Parts of what base numbers and the other causes are off by, from which they are fitted without it."""


def only_needed(search: Search) -> Search:
    """An estimated search without causes that others can do without.

    The misfit of wheels with play is rough, and a fit stands still in it before it has arrived. A cause that
    moves it on by chance has evidence as long as the others are fitted from where they stood: beside play and
    a latency of 34 ms a slip of 0.3 ms led by 20, and by 7 once they had been fitted from elsewhere.
    """
    while True:
        gone = _spare(search)
        if gone is None:
            return search
        name, fit = gone
        search = estimated(pruned(search, name, BETTER_TOGETHER, fit))


def _spare(search: Search) -> tuple[str, Fit] | None:
    """The cause that lacks most of what it must have, if any does, and the fit without it."""
    point, problem, whitener = search.fit.point, search.problem, search.whitener
    if not play_of(point):
        return None
    needs = {each: required_evidence(search, each, len(point.active) == 1) for each in point.active}
    asked = [name for name, needed in needs.items() if search.gains.get(name, needed) - needed < DOUBT]
    if not asked:
        return None

    def best(starts: list[Point]) -> Fit:
        fits = [fit_point(problem, whitener, start) for start in starts]
        return max(fits, key=lambda fit: lead(problem, fit, settled))

    settled = settled_fit(search)
    settled = best([settled.point, replace(settled.point, base=0.5 * settled.point.base)])
    without = {name: best(_starts(point.without_cause(name))) for name in asked}
    lacks = {name: needs[name] - lead(problem, settled, fit) for name, fit in without.items()}
    most = max(lacks, key=lambda name: lacks[name])
    return (most, without[most]) if lacks[most] > 0.0 else None


def _starts(point: Point) -> list[Point]:
    return [
        replace(
            point,
            base=part * point.base,
            active={name: others * u for name, u in point.active.items()},
        )
        for part, others in STARTS
    ]
