"""Whether friction may have changed within a drive: then a curve of it over time is asked for as well."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.linear_model import Linear
from raccoon.diagnose.result import Diagnosis
from raccoon.diagnose.select.gates import CROWDED
from raccoon.diagnose.select.probe_scores import best_probe
from raccoon.diagnose.select.state import Search, lead, look_around
from raccoon.diagnose.unknown.probes import RUBS_ANEW, probes_for
from raccoon.diagnose.unknown.sensors import PREFIX, Probe

HEAT = "motor.heating"
WANDERS = 1.9
"""Times the noise that is left of a wheel's unseen readings where friction changed by an eighth or more."""
PAID = 20.0
"""Log evidence that such friction may lack for its fifteen steps. In the place of hot motors worth 77 to 96
it explained nothing; of two robots that took a load 58 where heat had 48, and nothing where heat had 12."""


def may_rub_anew(found: Diagnosis, clearly_hot: Callable[[], bool]) -> bool:
    """Whether a change of friction may be behind what was found: motors that get hot, whose resistance rises
    as the friction of a robot that took a load, or wheels that are far off what nothing explains.

    clearly_hot: asked only where motors get hot and all else is explained, whether it is surely them.

    Asked for always, the curve's fifteen steps are fifteen more ways to be wrong in, for which the noise has
    room: of a deadband's 22.7 beside four causes on 12 s 19.8 were left. Beside a crowd of causes their forms
    are as far off, and the whole search that asks takes as long again.
    """
    if len(found.causes) >= CROWDED:
        return False
    wheels = [each for each in found.channels if each.name.startswith("motor.")]
    if any(each.rmse_after > WANDERS * each.noise_floor for each in wheels):
        return True
    return any(each.id == HEAT for each in found.causes) and not clearly_hot()


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
