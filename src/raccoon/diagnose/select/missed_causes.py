"""What a search has missed among many causes, asked for under the noise of its last fit."""

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
"""Of fewer causes than so many each that is lacking makes another less likely, by so much log evidence.
Beside four causes a scrub that was not there got 12.9."""
MAX_LINEARISATIONS = 4
"""Of what the present causes are fitted on, as far as every other fit is."""


def add_missed_cause(search: Search) -> Search | None:
    """An estimated search with the cause that has most beyond what it needs; None where none has.

    While a search goes on, a little of every effect that is off is noise, so that no cause stands for what
    the form of another has wrong. The more is named, the more is noise, and where much is wrong it hides what
    is there: a deadband worth 84 had 7. Friction of one wheel is not asked for: it is what the form of
    friction on both leaves.
    """
    if search.unknown or len(search.fit.point.active) < MANY_CAUSES:
        return None
    report(f"asking what was missed beside {', '.join(search.fit.point.active)}")
    problem = search.problem
    extra = search.probes(search.linear)
    table, plain = gram_tables(search.linear, extra, search.whitener)
    seen = replace(search, table=table, table_without_wander=plain)
    settled = fit_point(problem, search.whitener, search.fit.point, MAX_LINEARISATIONS)
    refits = refit_relinearised(seen, refit_candidates(seen))
    ranked = [(name, fit, nested_lead(problem, fit, settled)) for name, fit in refits]
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
    """Log evidence beyond its gate that a cause must have: as much as is lacking to a crowd, and twice what
    the form of what is named makes of any other. A limit of the current that did 9 times the noise had a gear
    that loses torque beside it with 39, and a filter with 16."""
    problem, named = search.problem, len(search.fit.point.active)
    strength = active_response_rms(search.linear.cause_responses, search.whitener.noise)
    width = problem.features.width / BIN_S
    readings = problem.features.measured.size * width  # as many as there are in bins of 20 ms
    return LEAD_PER_LACKING_CAUSE * max(FULL_SET - named, 0) + readings * form_error_rms(strength, width) ** 2
