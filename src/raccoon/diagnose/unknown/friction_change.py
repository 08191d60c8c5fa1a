"""Test whether friction may have changed within a drive, so that a probe of it over time is tried as well."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.linear_model import LinearModel
from raccoon.diagnose.result import Diagnosis
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import CROWDED_CAUSES
from raccoon.diagnose.select.probe_scores import find_best_probe
from raccoon.diagnose.select.state import Search, linearise_search
from raccoon.diagnose.unknown.probes import FRICTION_OVER_TIME, make_probe_function
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX, Probe

HEATING = "motor.heating"
MIN_NOISE_RATIO = 1.9
"""Ratio of a wheel's error on held-out data to its noise from which friction may have changed; a change by an
eighth or more reaches it."""
MAX_LOG_EVIDENCE_SHORTFALL = 20.0
"""Log evidence by which changing friction may be behind heating, for its fifteen steps. In the place of hot
motors worth 77 to 96 it explained nothing; on two robots that took a load it had 58 where heating had 48, and
nothing where heating had 12."""


def friction_may_have_changed(found: Diagnosis, is_clearly_heating: Callable[[], bool]) -> bool:
    """Whether a change of friction may explain the result: motors that get hot (their resistance rises like
    the friction of a robot that took a load), or wheels with a large unexplained error.

    is_clearly_heating: called only if motors get hot and everything else is explained; whether heating is
    certain.

    If it were always tried, the curve's fifteen steps would be fifteen more false directions, which the noise
    includes: of a deadband's 22.7 beside four causes in 12 s 19.8 were left. Beside CROWDED_CAUSES causes
    their form errors are as large, and the whole search with the probe takes as long again.
    """
    if len(found.causes) >= CROWDED_CAUSES:
        return False
    wheels = [each for each in found.channels if each.name.startswith("motor.")]
    if any(each.rmse_after > MIN_NOISE_RATIO * each.noise_floor for each in wheels):
        return True
    return any(each.id == HEATING for each in found.causes) and not is_clearly_heating()


def is_clearly_heating(search: Search) -> bool:
    """Whether motors that get hot were named, and friction that changes in steps explains so much less in
    their place that no search with it is needed: at most a part of the residual without heating."""
    point = search.fit.point
    heating = [each for each in point.active if each.startswith(HEATING)]
    if not heating:
        return False
    problem = replace(search.problem, friction_may_change=True)
    all_probes = make_probe_function(problem)

    def friction_probe(linear: LinearModel) -> Sequence[Probe]:
        return [each for each in all_probes(linear) if each.name == UNKNOWN_PREFIX + FRICTION_OVER_TIME]

    for name in heating:
        point = point.without_cause(name)
    unheated = fit_point(problem, search.whitener, point)
    around = linearise_search(problem, friction_probe, unheated.point, search.whitener, search.unknown)
    heated, unheated = (fit_point(problem, around.whitener, each.point) for each in (search.fit, unheated))
    return (
        log_evidence_lead(problem, heated, unheated)
        > find_best_probe(around).lead + MAX_LOG_EVIDENCE_SHORTFALL
    )
