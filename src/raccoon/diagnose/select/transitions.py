"""From one state of the search to the next: a cause taken, a cause dropped, another set in its place."""

from __future__ import annotations

from collections.abc import Sequence

from raccoon.diagnose.fit.backlash_scan import fit_scanned
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_many
from raccoon.diagnose.select.gates import EVIDENCE_GATE
from raccoon.diagnose.select.state import Rival, Search, lead, look_around

BETTER_TOGETHER = "others explain it better together"
"""Why a cause is not named that would be without them."""


def accepted(search: Search, name: str, fit: Fit, ranked: Sequence[tuple[str, Fit, float]] = ()) -> Search:
    """A cause taken, and all fitted on. ranked: what was tried in its place, of which those are its rivals
    that explain enough to be named.

    With a scan of play: on a stair that was a tenth too wide four other causes were named, and one was not.
    """
    rivals = [
        Rival(other, lead(search.problem, fit, each))
        for other, each, gain in ranked
        if other != name and gain > EVIDENCE_GATE
    ]
    again = fit_scanned(search.problem, search.whitener, fit.point)
    return moved(search, again, {**search.rivals, name: rivals})


def accepted_without(search: Search, name: str, fit: Fit) -> Search:
    """A cause dropped. fit: the one without it."""
    return moved(search, fit, {key: value for key, value in search.rivals.items() if key != name})


def replaced_by(search: Search, fit: Fit) -> Search:
    """Another set of causes in the place of the one that is on."""
    gone = [name for name in search.fit.point.active if name not in fit.point.active]
    search.failed.update(dict.fromkeys(gone, BETTER_TOGETHER))
    rivals = {name: each for name, each in search.rivals.items() if name in fit.point.active}
    return moved(search, fit, rivals)


def moved(search: Search, fit: Fit, rivals: dict[str, list[Rival]]) -> Search:
    """The search from a fit's point on; what failed before is remembered."""
    following = look_around(search.problem, search.probes, fit.point, search.whitener, search.unknown)
    following.rivals, following.failed = rivals, search.failed
    for now, before in ((following.gains, search.gains), (following.held_out, search.held_out)):
        now.update({name: each for name, each in before.items() if name in fit.point.active})
    return following


def settled_fit(search: Search) -> Fit:
    """The present causes fitted on, which every other fit is compared with."""
    return fit_many(search.problem, search.whitener, [search.fit.point], search.fit.jacobian, 2)[0]


def rows_without(search: Search, name: str) -> list[int]:
    """Rows of the fit's Jacobian but those of a cause that is on."""
    gone = search.table.active[name]
    return [row for row in range(len(search.fit.jacobian)) if row not in gone]
