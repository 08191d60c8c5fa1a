"""Replacement of several causes by one cause or another set: steps that a search by single causes does not
find."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_point, fit_with_frozen_columns
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select.alternative_sets import find_better_set
from raccoon.diagnose.select.fit_comparison import log_evidence_lead
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.refits import SHARED_SCALE_CAUSES, both_signs, may_miss_causes
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.select.transitions import (
    accept_cause,
    drop_cause,
    jacobian_rows_without,
    move_search,
    refit_current,
    replace_set,
)

MAX_SINGLE_DEFICIT = 3.0
"""Log evidence by which one cause alone may be behind to replace several."""


def merge_sides(search: Search) -> Search:
    """Merge a left and a right cause into one of both sides if two causes are not justified over one."""
    for name in [each for each in search.fit.point.active if each.endswith("@left")]:
        whole, other = name.removesuffix("@left"), name.replace("@left", "@right")
        active = search.fit.point.active
        if other not in active or whole not in search.problem.causes:
            continue
        rows = [row for row in jacobian_rows_without(search, name) if row not in search.table.active[other]]
        less = search.fit.point.without_cause(name).without_cause(other)
        sizes = (0.5 * (active[name] + active[other]), active[name], active[other])
        starts = [less.with_cause(whole, each) for each in sizes]
        separate = refit_current(search)
        fits = fit_with_frozen_columns(search.problem, search.whitener, starts, search.fit.jacobian[rows], 4)
        merged, lead = _best_lead(search, fits, separate)
        # Columns of the two causes may lead astray: backlash of both was 80 behind, and 36 ahead with its own
        # columns.
        if lead <= -gate(whole):
            fits = [fit_point(search.problem, search.whitener, each.point) for each in fits]
            merged, lead = _best_lead(search, fits, separate)
        if lead > -gate(whole):  # two causes must be justified over one
            return merge_sides(drop_cause(search, other, merged))
    return search


def split_sides(search: Search) -> Search:
    """Split a cause of both sides into one per side if a cause of a single side is active beside it: the same
    robot in numbers of each wheel. Its rivals become those of the other side's cause."""
    active = search.fit.point.active
    for name in active:
        whole, _, side = name.partition("@")
        other = f"{whole}@{'left' if side == 'right' else 'right'}"
        plain = whole in active and search.problem.causes[whole].joint is None
        if not side or not plain or other in active or other not in search.problem.causes:
            continue
        less = search.fit.point.without_cause(whole).with_cause(name, active[whole] + active[name])
        fit = fit_point(search.problem, search.whitener, less.with_cause(other, active[whole]))
        rivals = {key: each for key, each in search.rivals.items() if key != whole}
        rivals[other] = [each for each in search.rivals.get(whole, []) if each.name != other]
        following = move_search(search, fit, rivals)
        for leads, before in (
            (following.leads, search.leads),
            (following.held_out_leads, search.held_out_leads),
        ):
            if whole in before:
                leads[other] = before[whole]
        return split_sides(following)
    return search


def _best_lead(search: Search, fits: Sequence[Fit], other: Fit) -> tuple[Fit, float]:
    """The fit with the largest lead over another one, and that lead."""
    leads = [log_evidence_lead(search.problem, each, other) for each in fits]
    best = int(np.argmax(leads))
    return fits[best], leads[best]


def simplify_to_one_cause(search: Search) -> tuple[Search, bool]:
    """Replace several causes by one that explains as much, since two wrong ones can imitate a right one. Also
    returns whether that was done."""
    active = search.fit.point.active
    others = {each.name for rivals in search.rivals.values() for each in rivals}
    others |= {name.partition("@")[0] for name in (*active, *others)} & set(search.problem.causes)
    if set(active) & set(SHARED_SCALE_CAUSES):
        others |= set(SHARED_SCALE_CAUSES) & set(search.problem.causes)
    names = sorted(others - set(active))
    if len(active) < 2 or not names:
        return search, False
    bare = Point(search.fit.point.base)
    starts = [
        bare.with_cause(name, np.array(point))
        for name in names
        for variant in search.problem.causes[name].variants
        for point in variant[:1]
        for point in both_signs(search.problem, name, point)
    ]
    base = search.fit.jacobian[: len(bare.base)]
    current = refit_current(search)
    best = max(
        fit_with_frozen_columns(search.problem, search.whitener, starts, base, 5),
        key=lambda fit: fit.evidence,
    )
    if log_evidence_lead(search.problem, best, current) < -MAX_SINGLE_DEFICIT:
        return search, False
    name = next(iter(best.point.active))
    search.rejections.update(dict.fromkeys(active, f"{name} alone explains as much"))
    return accept_cause(search, name, best), True


def replace_by_better_sets(search: Search) -> tuple[Search, bool]:
    """Replace the set of causes by one that explains more, up to three times. Also returns whether that was
    done. It ends early with a better fit of the same set, which already led all others."""
    changed = False
    for _ in range(3):
        fit = find_better_set(search) if may_miss_causes(search.fit) else None
        if fit is None:
            break
        same = fit.point.active.keys() == search.fit.point.active.keys()
        search, changed = replace_set(search, fit), True
        if same:
            break
    return search, changed
