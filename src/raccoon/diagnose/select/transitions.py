"""Transitions of the search from one set of causes to another, after which it is linearised anew."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.diagnose.fit.backlash_scan import fit_with_backlash_scan
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_point, fit_with_frozen_columns
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import EVIDENCE_GATE
from raccoon.diagnose.select.state import Rival, Search, linearise_search

EXPLAINED_BETTER_TOGETHER = "others explain it better together"
"""Reason of a rejection: the other causes together explain what this one explained."""


def accept_cause(
    search: Search, name: str, fit: Fit, ranked: Sequence[tuple[str, Fit, float]] = ()
) -> Search:
    """Add a cause and refit everything. ranked: what was tried in its place; those of it that pass the usual
    gate are recorded as its rivals.

    The refit scans backlash: on a stair of the misfit that was a tenth too wide four other causes were named,
    and one was missed.
    """
    rivals = [
        Rival(other, log_evidence_lead(search.problem, fit, each), point=each.point)
        for other, each, gain in ranked
        if other != name and gain > EVIDENCE_GATE
    ]
    refit = fit_with_backlash_scan(search.problem, search.whitener, fit.point)
    return move_search(search, refit, {**search.rivals, name: rivals})


def drop_cause(search: Search, name: str, fit: Fit) -> Search:
    """Drop a cause. fit: the fit without it."""
    return move_search(search, fit, {key: value for key, value in search.rivals.items() if key != name})


def replace_set(search: Search, fit: Fit) -> Search:
    """Replace the active set of causes by that of a fit."""
    gone = [name for name in search.fit.point.active if name not in fit.point.active]
    search.rejections.update(dict.fromkeys(gone, EXPLAINED_BETTER_TOGETHER))
    rivals = {name: each for name, each in search.rivals.items() if name in fit.point.active}
    return move_search(search, fit, rivals)


def move_search(search: Search, fit: Fit, rivals: dict[str, list[Rival]]) -> Search:
    """Linearise the search at a fit's point; rejections, leads and held-out leads are carried over."""
    following = linearise_search(search.problem, search.probes, fit.point, search.whitener, search.unknown)
    following.rivals, following.rejections = rivals, search.rejections
    for carried, before in (
        (following.leads, search.leads),
        (following.held_out_leads, search.held_out_leads),
    ):
        carried.update({name: each for name, each in before.items() if name in fit.point.active})
    return following


def refit_beside_unknown(search: Search, unknown: dict[str, float], point: Point) -> Search:
    """The search at a point that is refitted with the curves of these probes as part of the noise."""
    following = linearise_search(search.problem, search.probes, point, search.whitener, unknown)
    refit = fit_point(search.problem, following.whitener, point)
    return linearise_search(search.problem, search.probes, refit.point, following.whitener, unknown)


def refit_current(search: Search) -> Fit:
    """The active causes refitted slightly further: the fit with which every other one is compared."""
    return fit_with_frozen_columns(
        search.problem, search.whitener, [search.fit.point], search.fit.jacobian, 2
    )[0]


def jacobian_rows_without(search: Search, name: str) -> list[int]:
    """Rows of the fit's Jacobian without those of an active cause."""
    gone = search.table.active[name]
    return [row for row in range(len(search.fit.jacobian)) if row not in gone]
