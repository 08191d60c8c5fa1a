"""Search for causes that were missed beside many others, under the noise of the last fit."""

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
"""Below that number of causes each one fewer makes a further cause less likely, by so much log evidence.
Beside four causes a scrub that the robot did not have got 12.9."""
MAX_LINEARISATIONS = 4
"""Linearisations of the refit of the present causes, as many as every other fit has."""


def add_missed_cause(search: Search) -> Search | None:
    """An estimated search with the further cause that exceeds its needed lead most; None where none does.

    While a search goes on, a little of every inactive effect counts as noise, so that no cause stands in for
    the error of form of another. The more causes are active, the more counts as noise, and where much is
    wrong it hides what exists: a deadband worth 84 had 7. Friction of one wheel is not considered: it is what
    the form of friction on both leaves.
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
    """Log evidence beyond its gate that a cause must have: an amount for each cause that a full set has more,
    and twice what errors of form of the active causes give any other. Beside a current limit whose response
    was 9 times the noise a gear that loses torque got 39, and a filter 16."""
    problem, named = search.problem, len(search.fit.point.active)
    strength = active_response_rms(search.linear.cause_responses, search.whitener.noise)
    width = problem.features.width / BIN_S
    readings = problem.features.measured.size * width  # as many as there are in bins of 20 ms
    return LEAD_PER_LACKING_CAUSE * max(FULL_SET - named, 0) + readings * form_error_rms(strength, width) ** 2
