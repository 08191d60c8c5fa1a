"""Which causes: forward by true refits, backward and swaps, each step gated by evidence and held-out
blocks."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.core.doing import tell
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_many, fit_point
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select.gates import MANY, gate
from raccoon.diagnose.select.probe_scores import Probed, best_probe
from raccoon.diagnose.select.refits import SEVERAL, doubtful, ranking, refit_candidates, refits_afresh
from raccoon.diagnose.select.replacements import merged, rearranged, simplified
from raccoon.diagnose.select.rivals import as_likely, compared
from raccoon.diagnose.select.state import (
    Foretold,
    Search,
    held_out_lead,
    lead,
    look_around,
)
from raccoon.diagnose.select.transitions import (
    BETTER_TOGETHER,
    accepted,
    accepted_without,
    replaced_by,
    rows_without,
    settled_fit,
)

HELD_OUT_GATE = 2.0
"""Log predictive score that a cause must add on blocks left out."""
SURE = 30.0
"""Log evidence, no event counting for much, from which a cause need not help on blocks left out."""
FORGIVEN = 0.4
"""Part of its log evidence beyond the gate by which a cause may fall short there."""
PROBE_GATE = 14.0
"""Lead from which a probe may go before a cause."""
PROBE_ALONE = 8.0
"""The same where nothing explains anything yet; what is left beside a cause, whose form is never quite the
robot's, has more."""
PROBE_LEAD = 1.3
"""Times the evidence of the best cause, no event limited, from which a probe goes before it."""
PROBE_FAR = 1.5
"""The same for leads: a cause with a few large moments right, and the rest of the drive not, is none."""
BESIDE_UNKNOWN = 0.33
"""Part of what something unknown explains that a cause beside it must explain at least."""
NOTHING = "explains nothing that is left"
MOST_CAUSES = 14
"""With which a search ends, however much is left: no robot has so many."""
OUTDONE = 5.0
"""Log evidence, no gates counted, by which another explains more in a cause's place than it does."""
WEAK = 3.0
"""Gates up to which a cause's worth, as the columns of the fit with it have it, is doubted."""


def forward(search: Search) -> tuple[Search, bool]:
    """Add the cause that explains most, if its evidence and its held-out blocks allow.

    A probe that explains far more than any cause goes first: what it describes is in no catalogue. It goes
    only where causes whose every column was simulated anew are behind it as well: a friction that makes
    wheels stop is a poor fit along the columns of wheels that never did, and a curve over speed is not.
    """
    refits = refit_candidates(search)
    settled = settled_fit(search)
    ranked = ranking(search.problem, refits, settled)
    probe = best_probe(search)
    afresh = _far_ahead(probe, ranked, settled)
    if afresh:
        ranked = ranking(search.problem, refits_afresh(search, refits), settled)
        if _far_ahead(probe, ranked, settled):
            return _with_unknown(search, probe), True
    taken = _first_that_passes(search, ranked, settled)
    alone = not (search.fit.point.active or search.unknown)
    shows = probe.shows(PROBE_ALONE if alone else PROBE_GATE)
    if taken is None and not afresh and (shows or doubtful(settled)):
        ranked = ranking(search.problem, refits_afresh(search, refits), settled)
        taken = _first_that_passes(search, ranked, settled)
    if taken is not None:
        return taken, True
    return (_with_unknown(search, probe), True) if shows else (search, False)


def _far_ahead(probe: Probed, ranked: Sequence[tuple[str, Fit, float]], settled: Fit) -> bool:
    """Whether a probe explains so much more than any cause that it goes first."""
    most = max((fit.evidence - settled.evidence for _, fit, _ in ranked), default=0.0)
    furthest = max((gain for _, _, gain in ranked), default=0.0)
    further = probe.lead > PROBE_FAR * furthest or probe.evidence > PROBE_LEAD * max(most, 0.0)
    return probe.shows(PROBE_GATE) and further


def _first_that_passes(
    search: Search, ranked: Sequence[tuple[str, Fit, float]], settled: Fit
) -> Search | None:
    """The search with the first cause that has the evidence it needs and helps on blocks left out; None where
    there is none. Why the others are not taken is noted."""
    before = Foretold.of(settled)
    for name, fit, gain in ranked:
        needed = required_evidence(search, name, alone=not search.fit.point.active)
        if gain < needed:
            search.failed[name] = _too_little(gain, fit.evidence - settled.evidence, needed)
            continue
        held_out = held_out_lead(search.problem, Foretold.of(fit), before)
        if _fails_held_out(gain, needed, held_out):
            search.failed[name] = f"does not help on data it was not fitted on ({held_out:+.1f})"
            continue
        return accepted(search, name, fit, ranked)
    return None


def _too_little(lead: float, evidence: float, needed: float) -> str:
    """Why a cause is not named. lead: its log evidence, no event counting for much; evidence: all of it."""
    if evidence > needed:
        return (
            f"shows in too few moments of this recording (log evidence {lead:+.1f} of {evidence:+.1f} counts)"
        )
    if lead <= 0.0:
        return NOTHING
    return f"explains too little (log evidence {lead:+.1f})"


def required_evidence(search: Search, name: str, alone: bool) -> float:
    """The gate; beside something unknown a cause must explain a fair part of what that explains."""
    if search.unknown:
        return max(gate(name), BESIDE_UNKNOWN * max(search.unknown.values()))
    return gate(name, alone)


def _fails_held_out(gain: float, needed: float, held_out: float) -> bool:
    """Whether a cause must help on blocks left out and does not. They are predicted by straight lines, which
    a large cause bends.

    needed: the log evidence that it must have.
    """
    wanted = HELD_OUT_GATE - FORGIVEN * max(gain - needed, 0.0)
    return held_out < wanted and gain < SURE


def _with_unknown(search: Search, probe: Probed) -> Search:
    """Start again with the probe's curve as part of the noise: causes must earn their place beside it."""
    unknown = {**search.unknown, probe.name: probe.lead}
    return beside_unknown(search, unknown, Point(search.fit.point.base))


def beside_unknown(search: Search, unknown: dict[str, float], point: Point) -> Search:
    """A point fitted anew, and seen from, with the curves of these probes as noise."""
    following = look_around(search.problem, search.probes, point, search.whitener, unknown)
    again = fit_point(search.problem, following.whitener, point)
    return look_around(search.problem, search.probes, again.point, following.whitener, unknown)


def backward(search: Search) -> tuple[Search, bool]:
    """Drop a cause that no longer earns its place."""
    settled = settled_fit(search)
    foretold = Foretold.of(settled)
    names = list(search.fit.point.active)
    for name in names:
        dropped = _dropped(search, settled, name)
        search.gains[name] = lead(search.problem, settled, dropped)
        search.held_out[name] = held_out_lead(search.problem, foretold, Foretold.of(dropped))
        needed = required_evidence(search, name, alone=len(names) == 1)
        fails = _fails_held_out(search.gains[name], needed, search.held_out[name])
        if search.gains[name] < needed or fails:
            search.failed[name] = BETTER_TOGETHER
            return accepted_without(search, name, dropped), True
    return search, False


def _dropped(search: Search, settled: Fit, name: str) -> Fit:
    """The fit without a cause; where it is worth little, all the others must have had their chance."""
    problem, whitener, less = search.problem, search.whitener, search.fit.point.without_cause(name)
    dropped = fit_many(problem, whitener, [less], search.fit.jacobian[rows_without(search, name)], 3)[0]
    gain = lead(problem, settled, dropped)
    if not gate(name) < gain < WEAK * gate(name) or not less.active:
        return dropped
    again = fit_point(problem, whitener, dropped.point)
    return again if again.cost < dropped.cost else dropped


def pruned(search: Search, name: str, why: str, fit: Fit | None = None) -> Search:
    """The search without a cause that does not stand after all. fit: the one without it, if it is known.

    Among many the others stay: what was found under the noise of a last fit has less under that of a search.
    """
    search.failed[name] = why
    if fit is None:
        fit = fit_point(search.problem, search.whitener, search.fit.point.without_cause(name))
    following = accepted_without(search, name, fit)
    return following if len(following.fit.point.active) >= MANY else backward(following)[0]


def grown(search: Search, most: int = MOST_CAUSES) -> Search:
    """The first part of a search: causes added one by one, those that lose their place dropped.

    Until a drop leaves no more causes than one before it did: several that are worth little take each other's
    place one after the other, and each time takes as long as all that was found before.
    """
    left = -1
    for _ in range(2 * MOST_CAUSES):
        tell(f"looking for causes; so far {search.listed}")
        if len(search.fit.point.active) >= most:
            break
        search, added = forward(search)
        search = merged(search)
        if not added:
            break
        if len(search.fit.point.active) > (0 if search.unknown else 1):
            search, removed = backward(search)
            if removed:
                before, left = left, len(search.named)
                if left <= before:
                    break
    return search


def begun(search: Search) -> Search:
    """The beginning of that, as long as it is quick: beside several causes each further one takes as long."""
    return grown(search, SEVERAL)


def grown_on(search: Search) -> Search:
    """All of the first part from its beginning on, which has ended by itself where it has fewer causes."""
    return grown(search) if len(search.fit.point.active) >= SEVERAL else search


def gone_on(search: Search) -> Search:
    """The whole search from its beginning on."""
    return finished(grown_on(search))


def known_after_all(search: Search) -> tuple[Search, bool]:
    """The search without what was called unknown, where it is not the next step beside the causes that were
    found since."""
    if not search.unknown or not search.fit.point.active or search.problem.change is not None:
        return search, False
    bare = beside_unknown(search, {}, search.fit.point)
    bare.rivals, bare.failed = search.rivals, dict(search.failed)
    following, _ = forward(bare)
    return (search, False) if following.unknown else (following, True)


def whole(start: Search) -> Search:
    """The whole search, from its start to a set of causes that is stable in both directions."""
    return finished(grown(start))


def finished(search: Search) -> Search:
    """The rest of a search: sets of causes that explain more, until one is stable."""
    search, known = known_after_all(search)
    if known:
        search = grown(search)
    search, replaced = simplified(search)
    if replaced:
        search, _ = forward(search)
    tell(f"trying other sets of causes than {search.listed}")
    search, changed = rearranged(search)
    if changed:
        search = grown(search)
    search = _stable(search)
    tell(f"asking what else may be in the place of {search.listed}")
    better, before = compared(search), frozenset(search.fit.point.active)
    if better is not None:
        search = _stable(grown(replaced_by(search, better)))
        again = compared(search)
        if again is not None and before == frozenset(again.point.active):
            as_likely(search, before)
    return _credible(search)


def _credible(search: Search) -> Search:
    """Without a cause whose place something else would fill better: what needs more to be named, as friction
    of one wheel does, which a floor imitates. It is nearer to what is there than the cause, named or not.

    Where that something is named once the place is free, and the cause beside it again, both are there.
    """
    seen = set()
    while True:
        seen.add(frozenset(search.fit.point.active))
        places = {name: [each for each in its if not each.beside] for name, its in search.rivals.items()}
        best = {name: min(its, key=lambda each: each.lead) for name, its in places.items() if its}
        worst = min(best, key=lambda name: best[name].lead, default=None)
        if worst is None or best[worst].lead > -OUTDONE:
            return search
        search.failed[worst] = "something that explains too little itself explains it better"
        less = accepted_without(search, worst, _dropped(search, settled_fit(search), worst))
        filled = grown(less)
        named = frozenset(filled.fit.point.active)
        both = best[worst].name in named and named not in seen
        search = _stable(filled if both or worst not in named else less)
        compared(search)


def _stable(search: Search) -> Search:
    """Nothing to be merged, nothing to be dropped."""
    search = merged(search)
    return backward(search)[0] if search.fit.point.active else search
