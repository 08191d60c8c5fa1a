"""Search for causes that were missed beside many others, with the noise of the last fit."""

from __future__ import annotations

from dataclasses import replace

from raccoon.core.progress import report
from raccoon.diagnose.drives.features import BIN_S
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.linear_model import gram_tables
from raccoon.diagnose.fit.noise_estimation import active_response_rms, form_error_rms
from raccoon.diagnose.select.fit_comparison import nested_lead
from raccoon.diagnose.select.gates import MANY_CAUSES, WHEEL_GATE, gate
from raccoon.diagnose.select.refits import refit_candidates, refit_relinearised
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.transitions import accept_cause

FULL_SET, LEAD_PER_LACKING_CAUSE = 7, 2.0
"""If fewer than FULL_SET causes are named, each one fewer raises the required lead of a further cause by
LEAD_PER_LACKING_CAUSE of log evidence: the fewer are named, the less likely is another. Beside four causes a
scrub that the robot did not have got 12.9."""
MAX_LINEARISATIONS = 4
"""Linearisations of the refit of the present causes, as many as in all other fits."""


def add_missed_cause(search: Search) -> Search | None:
    """The final search with one further cause, the one that exceeds its required lead most; None if none
    reaches it.

    During a search a small deviation of every inactive effect counts as noise, so that no cause is named for
    the form error of another. With more active causes this noise is larger, and if much is wrong it hides
    real causes: a deadband worth 84 had 7. Friction of one wheel is not tried: it imitates the form error of
    the friction of both.
    """
    if search.unknown or len(search.fit.point.active) < MANY_CAUSES:
        return None
    report(f"asking what was missed beside {', '.join(search.fit.point.active)}")
    problem = search.problem
    extra = search.probes(search.linear)
    table, plain = gram_tables(search.linear, extra, search.whitener)
    final = replace(search, table=table, table_without_wander=plain)
    current = fit_point(problem, search.whitener, search.fit.point, MAX_LINEARISATIONS)
    refits = refit_relinearised(final, refit_candidates(final))
    ranked = [(name, fit, nested_lead(problem, fit, current)) for name, fit in refits]
    further = _extra_lead_needed(search)
    enough = [each for each in ranked if gate(each[0]) + further <= each[2] and gate(each[0]) < WHEEL_GATE]
    if not enough:
        return None
    name, fit, gain = max(enough, key=lambda each: each[2] - gate(each[0]))
    following = accept_cause(search, name, fit, ranked)
    following.leads[name] = gain
    following.rejections.pop(name, None)
    return following


def _extra_lead_needed(search: Search) -> float:
    """Log evidence beyond its gate that a further cause needs: LEAD_PER_LACKING_CAUSE for each cause fewer
    than FULL_SET, and twice the log evidence that form errors of the active causes can give any other. Beside
    a current limit whose response was 9 times the noise, a gear that loses torque got 39, and a filter 16."""
    problem, named = search.problem, len(search.fit.point.active)
    strength = active_response_rms(search.linear.cause_responses, search.whitener.noise)
    width = problem.features.width / BIN_S
    readings = problem.features.measured.size * width  # their number in bins of 20 ms
    return LEAD_PER_LACKING_CAUSE * max(FULL_SET - named, 0) + readings * form_error_rms(strength, width) ** 2
