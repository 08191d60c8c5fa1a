"""Validation of the causes at the end of a search: on held-out data, and by the size of their numbers."""

from __future__ import annotations

from collections.abc import Collection

from raccoon.core.progress import report
from raccoon.diagnose.findings.cause_results import fitted_parameters, largest_deviation
from raccoon.diagnose.findings.held_out import HeldOut, evaluate_held_out
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.select.missed_causes import add_missed_cause
from raccoon.diagnose.select.replacements import split_sides
from raccoon.diagnose.select.search import prune_cause
from raccoon.diagnose.select.state import Rival, Search, refit_with_final_noise
from raccoon.diagnose.select.transitions import EXPLAINED_BETTER_TOGETHER
from raccoon.diagnose.select.unneeded_causes import find_unneeded_cause

CLEAR_LOG_EVIDENCE = 25.0
"""Log evidence from which a cause is kept whatever its error on another recording, since battery, floor and
load may differ there. The same applies within one recording if the error is as large as expected: a friction
worth 218 was dropped because of 12 s in which a wheel stopped a moment late."""

MIN_DEVIATIONS = 1.75
"""Standard deviations by which a cause's number must differ from the assumed one: odds of 5 to 1. Below that
were a slip of 0.35 +- 0.21 ms and a resistance of 0.76 +- 0.76, which absorbed an otherwise unexplained
residual. A single clear cause is exempt, since there is no other whose form error it could absorb: of
backlash of 0.15 rad, worth 47, a short drive gave 0.15 +- 0.12, since the misfit is flat there."""
HARMFUL_REASON = "makes the error larger on data it was not fitted on"
NO_SIZE_REASON = "has no number that differs from what was assumed"


def validate_causes(search: Search, other: Problem | None) -> tuple[Search, HeldOut]:
    """The search with the causes that hold on held-out data, and their scores there."""
    search = refit_with_final_noise(split_sides(search))
    while (more := add_missed_cause(search)) is not None:
        search = refit_with_final_noise(more)
    report("judging on data that was not fitted")
    search = _drop_unneeded(search)
    judged = evaluate_held_out(search, other)
    while True:
        trusts_evidence = other is not None or judged.size_after <= judged.size_expected
        clear = [
            name for name, gain in search.leads.items() if trusts_evidence and gain >= CLEAR_LOG_EVIDENCE
        ]
        errors = {name: error for name, error in judged.without.items() if name not in clear}
        worst = min(errors, key=lambda name: errors[name], default=None)
        if worst is None or errors[worst] > judged.harm_limit:
            break
        search = _drop_unneeded(refit_with_final_noise(prune_cause(search, worst, HARMFUL_REASON)))
        judged = evaluate_held_out(search, other)
    return search, judged


def _drop_unneeded(search: Search) -> Search:
    """A finished search without the causes that the others make unneeded, or whose number does not differ
    from the assumed one."""
    while True:
        if spared := find_unneeded_cause(search):
            search = refit_with_final_noise(
                prune_cause(search, spared[0], EXPLAINED_BETTER_TOGETHER, spared[1])
            )
        elif sizeless := _causes_without_size(search):
            name, *others = sizeless
            search = refit_with_final_noise(prune_cause(search, name, NO_SIZE_REASON, None))
            if others:
                _note_absorbed(search, name, set(others) - set(_causes_without_size(search)))
        else:
            return search


def _causes_without_size(search: Search) -> list[str]:
    """The causes whose numbers are too near to the assumed ones, the nearest first."""
    if not search.fit.point.active:
        return []
    uncertainty, causes = FitUncertainty.of(search), search.problem.causes
    stds_away = {
        name: largest_deviation(causes[name].effect, fitted_parameters(search, causes[name], uncertainty))
        for name in search.fit.point.active
    }
    if len(stds_away) == 1 and max(search.leads.values(), default=0.0) >= CLEAR_LOG_EVIDENCE:
        return []
    return sorted(
        (name for name in stds_away if stds_away[name] < MIN_DEVIATIONS), key=lambda name: stds_away[name]
    )


def _note_absorbed(search: Search, gone: str, others: Collection[str]) -> None:
    """For each cause whose number became clear when another was dropped, record that other as acting beside
    it: a gyro 1.0 +- 0.6 ms late beside a slip of 1.4 +- 1.0 ms was reported as 2.0 +- 0.2 ms late, without a
    slip."""
    for name in search.fit.point.active.keys() & others:
        known = [each for each in search.rivals.get(name, []) if each.name != gone]
        search.rivals[name] = [Rival(gone, 0.0, beside=True), *known]
