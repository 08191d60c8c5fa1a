"""Model selection: causes are added one at a time by nonlinear refits, dropped and exchanged. In each step a
cause must reach its gate of log evidence and improve the prediction of held-out blocks."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.core.progress import report
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_point, fit_with_frozen_columns
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select.fit_comparison import HeldOutPrediction, held_out_lead, log_evidence_lead
from raccoon.diagnose.select.gates import MANY_CAUSES, gate
from raccoon.diagnose.select.probe_scores import ProbeScore, find_best_probe
from raccoon.diagnose.select.refits import (
    SEVERAL_CAUSES,
    may_miss_causes,
    rank_refits,
    refit_candidates,
    refit_relinearised,
)
from raccoon.diagnose.select.replacements import merge_sides, replace_by_better_sets, simplify_to_one_cause
from raccoon.diagnose.select.rivals import compare_rivals, mark_as_likely
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.transitions import (
    EXPLAINED_BETTER_TOGETHER,
    accept_cause,
    drop_cause,
    jacobian_rows_without,
    refit_beside_unknown,
    refit_current,
    replace_set,
)

HELD_OUT_GATE = 2.0
"""Log predictive score that a cause must add on held-out blocks."""
HELD_OUT_EXEMPT_LEAD = 30.0
"""Lead from which a cause need not improve the prediction of held-out blocks."""
HELD_OUT_ALLOWANCE = 0.4
"""Share of a cause's lead beyond its gate by which it may fall short on held-out blocks."""
PROBE_GATE = 14.0
"""Lead from which a probe may be taken before a cause."""
LONE_PROBE_GATE = 8.0
"""The same if no cause or curve was found yet. The residual beside a cause has more, since no cause has
exactly the robot's form."""
MIN_PROBE_EVIDENCE_RATIO = 1.3
"""Ratio of a probe's unlimited log evidence to the best cause's from which the probe is taken first."""
MIN_PROBE_LEAD_RATIO = 1.5
"""The same for leads: a cause that explains a few large moments and not the rest of the drive is none."""
MIN_SHARE_BESIDE_UNKNOWN = 0.33
"""Share of a taken probe's lead that a cause beside it needs as its lead."""
EXPLAINS_NOTHING = "explains none of the remaining error"
MAX_CAUSES = 14
"""Number of causes at which a search ends, however large the residual: no robot has so many."""
OUTPERFORMED_LEAD = 5.0
"""Lead, without gates, of a rival in a cause's place from which it outperforms the cause."""
WEAK_LEAD_GATES = 3.0
"""Lead, in gates, below which a cause is checked by a refit of the others with new columns."""


def forward_step(search: Search) -> tuple[Search, bool]:
    """Add the cause that explains most and passes its gates. Also returns whether anything was added.

    A probe that explains far more than any cause is taken first: its effect is outside the catalogue. The
    causes must be behind it also after a refit with new columns: for a friction that stops the wheels, the
    columns of turning wheels fit badly, while a curve over speed fits well.
    """
    refits = refit_candidates(search)
    current = refit_current(search)
    ranked = rank_refits(search.problem, refits, current)
    probe = find_best_probe(search)
    relinearised = _probe_goes_first(probe, ranked, current)
    if relinearised:
        ranked = rank_refits(search.problem, refit_relinearised(search, refits), current)
        if _probe_goes_first(probe, ranked, current):
            return _restart_beside_probe(search, probe), True
    following = _accept_first_passing(search, ranked, current)
    alone = not (search.fit.point.active or search.unknown)
    shows = probe.exceeds(LONE_PROBE_GATE if alone else PROBE_GATE)
    if following is None and not relinearised and (shows or may_miss_causes(current)):
        ranked = rank_refits(search.problem, refit_relinearised(search, refits), current)
        following = _accept_first_passing(search, ranked, current)
    if following is not None:
        return following, True
    return (_restart_beside_probe(search, probe), True) if shows else (search, False)


def _probe_goes_first(probe: ProbeScore, ranked: Sequence[tuple[str, Fit, float]], current: Fit) -> bool:
    """Whether a probe explains so much more than any cause that it is taken first."""
    max_evidence = max((fit.evidence - current.evidence for _, fit, _ in ranked), default=0.0)
    max_lead = max((lead for _, _, lead in ranked), default=0.0)
    leads = probe.lead > MIN_PROBE_LEAD_RATIO * max_lead
    return probe.exceeds(PROBE_GATE) and (
        leads or probe.evidence > MIN_PROBE_EVIDENCE_RATIO * max(max_evidence, 0.0)
    )


def _accept_first_passing(
    search: Search, ranked: Sequence[tuple[str, Fit, float]], current: Fit
) -> Search | None:
    """The search with the first cause that passes its gate and the held-out blocks; None if none does.
    Records why the others are rejected."""
    before = HeldOutPrediction.of(current)
    for name, fit, lead in ranked:
        needed = required_evidence(search, name, alone=not search.fit.point.active)
        if lead < needed:
            evidence = fit.evidence - current.evidence
            search.rejections[name] = _describe_lacking_evidence(lead, evidence, needed)
            continue
        held_out = held_out_lead(search.problem, HeldOutPrediction.of(fit), before)
        if _fails_held_out(lead, needed, held_out):
            search.rejections[name] = f"does not help on data it was not fitted on ({held_out:+.1f})"
            continue
        return accept_cause(search, name, fit, ranked)
    return None


def _describe_lacking_evidence(lead: float, evidence: float, needed: float) -> str:
    """Reason why a cause is not named. lead: its log evidence with events limited; evidence: unlimited."""
    if evidence > needed:
        return (
            f"shows in too few moments of this recording (only {lead:+.1f} of a log evidence of "
            f"{evidence:+.1f} counts)"
        )
    if lead <= 0.0:
        return EXPLAINS_NOTHING
    return f"explains too little (log evidence {lead:+.1f})"


def required_evidence(search: Search, name: str, alone: bool) -> float:
    """Lead that a cause needs: its gate, and beside something unknown at least a share of that probe's
    lead."""
    if search.unknown:
        return max(gate(name), MIN_SHARE_BESIDE_UNKNOWN * max(search.unknown.values()))
    return gate(name, alone)


def _fails_held_out(lead: float, needed: float, held_out: float) -> bool:
    """Whether a cause is required to improve the prediction of held-out blocks and does not. The prediction
    is by a linear model, from which a large cause departs. needed: see `required_evidence`."""
    wanted = HELD_OUT_GATE - HELD_OUT_ALLOWANCE * max(lead - needed, 0.0)
    return held_out < wanted and lead < HELD_OUT_EXEMPT_LEAD


def _restart_beside_probe(search: Search, probe: ProbeScore) -> Search:
    """Restart the search with the probe's curve as part of the noise: causes must then pass their gates
    beside it."""
    unknown = {**search.unknown, probe.name: probe.lead}
    return refit_beside_unknown(search, unknown, Point(search.fit.point.base))


def backward_step(search: Search) -> tuple[Search, bool]:
    """Drop the first cause that no longer passes its gates. Also returns whether there was one."""
    current = refit_current(search)
    prediction = HeldOutPrediction.of(current)
    names = list(search.fit.point.active)
    for name in names:
        dropped = _fit_without_cause(search, current, name)
        search.leads[name] = log_evidence_lead(search.problem, current, dropped)
        search.held_out_leads[name] = held_out_lead(search.problem, prediction, HeldOutPrediction.of(dropped))
        needed = required_evidence(search, name, alone=len(names) == 1)
        fails = _fails_held_out(search.leads[name], needed, search.held_out_leads[name])
        if search.leads[name] < needed or fails:
            search.rejections[name] = EXPLAINED_BETTER_TOGETHER
            return drop_cause(search, name, dropped), True
    return search, False


def _fit_without_cause(search: Search, current: Fit, name: str) -> Fit:
    """The fit without a cause. If the cause's lead is small, the others are fitted with new columns."""
    problem, whitener, less = search.problem, search.whitener, search.fit.point.without_cause(name)
    columns = search.fit.jacobian[jacobian_rows_without(search, name)]
    dropped = fit_with_frozen_columns(problem, whitener, [less], columns, 3)[0]
    lead = log_evidence_lead(problem, current, dropped)
    if not gate(name) < lead < WEAK_LEAD_GATES * gate(name) or not less.active:
        return dropped
    refit = fit_point(problem, whitener, dropped.point)
    return refit if refit.cost < dropped.cost else dropped


def prune_cause(search: Search, name: str, why: str, fit: Fit | None = None) -> Search:
    """The search without a cause that is rejected afterwards. fit: the fit without it, if it exists.

    Among many causes no others are eliminated: causes found under the noise of a last fit have less evidence
    under the noise of a search.
    """
    search.rejections[name] = why
    if fit is None:
        fit = fit_point(search.problem, search.whitener, search.fit.point.without_cause(name))
    following = drop_cause(search, name, fit)
    return following if len(following.fit.point.active) >= MANY_CAUSES else backward_step(following)[0]


def select_forward(search: Search, max_causes: int = MAX_CAUSES) -> Search:
    """Stepwise selection, the first part of a search: causes are added one by one, and dropped if they no
    longer pass their gates.

    It ends when a drop leaves no more causes than the drop before: several weak causes would replace each
    other in turn, and each turn takes as long as the whole search so far.
    """
    remaining = -1
    for _ in range(2 * MAX_CAUSES):
        report(f"looking for causes; so far {search.listed}")
        if len(search.fit.point.active) >= max_causes:
            break
        search, added = forward_step(search)
        search = merge_sides(search)
        if not added:
            break
        if len(search.fit.point.active) > (0 if search.unknown else 1):
            search, removed = backward_step(search)
            if removed:
                before, remaining = remaining, len(search.named)
                if remaining <= before:
                    break
    return search


def start_selection(search: Search) -> Search:
    """The quick first part of the selection; beside SEVERAL_CAUSES, each further cause takes as long as all
    of it."""
    return select_forward(search, SEVERAL_CAUSES)


def continue_selection(search: Search) -> Search:
    """The rest of `select_forward`, unless `start_selection` ended by itself with fewer causes."""
    return select_forward(search) if len(search.fit.point.active) >= SEVERAL_CAUSES else search


def resume_search(search: Search) -> Search:
    """The rest of a search after `start_selection`."""
    return refine_selection(continue_selection(search))


def reconsider_unknown(search: Search) -> tuple[Search, bool]:
    """The search without its unknown probes if they would not be taken again beside the causes found since.
    Also returns whether that is the case."""
    if not search.unknown or not search.fit.point.active or search.problem.change is not None:
        return search, False
    bare = refit_beside_unknown(search, {}, search.fit.point)
    bare.rivals, bare.rejections = search.rivals, dict(search.rejections)
    following, _ = forward_step(bare)
    return (search, False) if following.unknown else (following, True)


def run_search(start: Search) -> Search:
    """The whole search, from its start to a set of causes from which none is added or dropped."""
    return refine_selection(select_forward(start))


def refine_selection(search: Search) -> Search:
    """The rest of a search after `select_forward`: other sets of causes, elimination, rivals."""
    search, known = reconsider_unknown(search)
    if known:
        search = select_forward(search)
    search, replaced = simplify_to_one_cause(search)
    if replaced:
        search, _ = forward_step(search)
    report(f"trying other sets of causes than {search.listed}")
    search, changed = replace_by_better_sets(search)
    if changed:
        search = select_forward(search)
    search = _eliminate(search)
    report(f"looking for alternatives to {search.listed}")
    better, before = compare_rivals(search), frozenset(search.fit.point.active)
    if better is not None:
        search = _eliminate(select_forward(replace_set(search, better)))
        back = compare_rivals(search)
        if back is not None and before == frozenset(back.point.active):
            mark_as_likely(search, before)
    return _drop_outperformed(search)


def _drop_outperformed(search: Search) -> Search:
    """Drop each cause in whose place a rival explains more although the rival does not reach its own gate (as
    friction of one wheel may not, which a floor imitates): named or not, it is nearer to the truth.

    If the rival is named once its place is free, and then the cause beside it again, both are kept.
    """
    seen = set()
    while True:
        seen.add(frozenset(search.fit.point.active))
        instead = {name: [one for one in all_ if not one.beside] for name, all_ in search.rivals.items()}
        best = {name: min(found, key=lambda one: one.lead) for name, found in instead.items() if found}
        worst = min(best, key=lambda name: best[name].lead, default=None)
        if worst is None or best[worst].lead > -OUTPERFORMED_LEAD:
            return search
        search.rejections[worst] = "another cause explains it better, but too little to be named itself"
        less = drop_cause(search, worst, _fit_without_cause(search, refit_current(search), worst))
        filled = select_forward(less)
        named = frozenset(filled.fit.point.active)
        both = best[worst].name in named and named not in seen
        search = _eliminate(filled if both or worst not in named else less)
        compare_rivals(search)


def _eliminate(search: Search) -> Search:
    """Merge sides, then drop one cause that no longer passes its gates."""
    search = merge_sides(search)
    return backward_step(search)[0] if search.fit.point.active else search
