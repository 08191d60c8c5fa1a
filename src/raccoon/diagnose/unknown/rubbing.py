"""Whether friction that changed in a drive may be behind motors that are said to get hot, asked at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.diagnose.fit.fits import fit_point
from raccoon.diagnose.fit.linear import Linear
from raccoon.diagnose.select.outlook import Search, lead, look_around
from raccoon.diagnose.select.probed import best_probe
from raccoon.diagnose.unknown.probes import RUBS_ANEW, probes_for
from raccoon.diagnose.unknown.sensors import PREFIX, Probe

HEAT = "motor.heating"
PAID = 20.0
"""Log evidence that such friction may lack for its fifteen steps. In the place of hot motors worth 77 to 96
it explained nothing; of two robots that took a load 58 where heat had 48, and nothing where heat had 12."""


def clearly_hot(search: Search) -> bool:
    """Whether motors were named that get hot, and friction that changes in steps explains so much less in
    their place that no search with it need be made: what it does is what is left without them, or a part."""
    point, hot = search.fit.point, [each for each in search.fit.point.active if each.startswith(HEAT)]
    if not hot:
        return False
    problem = replace(search.problem, rubs_anew=True)
    every = probes_for(problem)

    def steps(linear: Linear) -> Sequence[Probe]:
        return [each for each in every(linear) if each.name == PREFIX + RUBS_ANEW]

    for name in hot:
        point = point.without_cause(name)
    cold = fit_point(problem, search.whitener, point)
    seen = look_around(problem, steps, cold.point, search.whitener, search.unknown)
    heated, cold = (fit_point(problem, seen.whitener, each.point) for each in (search.fit, cold))
    return lead(problem, heated, cold) > best_probe(seen).lead + PAID
