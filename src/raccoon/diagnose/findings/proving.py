"""Which of the causes that a search ended with stand, and how they do on data that no fit has seen."""

from __future__ import annotations

from collections.abc import Collection

from raccoon.core.doing import tell
from raccoon.diagnose.findings.gain import HeldOut, held_out
from raccoon.diagnose.findings.naming import deviations, parameters
from raccoon.diagnose.findings.spread import Spread
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.select.missed_causes import with_missed
from raccoon.diagnose.select.replacements import taken_apart
from raccoon.diagnose.select.search import pruned
from raccoon.diagnose.select.state import Rival, Search, estimated
from raccoon.diagnose.select.transitions import BETTER_TOGETHER
from raccoon.diagnose.select.unneeded_causes import spare

CLEAR = 25.0
"""Log evidence from which a cause stands whatever its error on another recording: a battery, a floor and what
a robot carries may be others there. So it does in the same one where the error is as large as is expected: a
friction worth 218 was dropped by 12 s in which a wheel stopped a moment late."""

AWAY = 1.75
"""Standard deviations by which the number of what is named is away from what was assumed, which is 5 to 1.
Nearer were a slip of 0.35 +- 0.21 ms and a resistance of 0.76 +- 0.76, which took up what nothing else did. A
lone cause that is clear has nothing beside it whose form it could make up for: of play of 0.15 rad, worth 47,
a short drive said 0.15 +- 0.12, as the misfit is flat there, and nothing without it."""
HARMFUL = "makes the error larger on data it was not fitted on"
NO_SIZE = "has no number that differs from what was assumed"


def proven(search: Search, other: Problem | None) -> tuple[Search, HeldOut]:
    """The causes that stand on unseen data, and how they do there."""
    search = estimated(taken_apart(search))
    while (more := with_missed(search)) is not None:
        search = estimated(more)
    tell("judging on data that was not fitted")
    search = _standing(search)
    judged = held_out(search, other)
    while True:
        excused = other is not None or judged.size_after <= judged.foreseen
        sure = [name for name, gain in search.gains.items() if excused and gain >= CLEAR]
        errors = {name: error for name, error in judged.without.items() if name not in sure}
        worst = min(errors, key=lambda name: errors[name], default=None)
        if worst is None or errors[worst] > judged.harmless:
            break
        search = _standing(estimated(pruned(search, worst, HARMFUL)))
        judged = held_out(search, other)
    return search, judged


def _standing(search: Search) -> Search:
    """An estimated search without causes that others can do without or whose own number does not tell from
    none."""
    while True:
        if spared := spare(search):
            search = estimated(pruned(search, spared[0], BETTER_TOGETHER, spared[1]))
        elif sizeless := _sizeless(search):
            name, *others = sizeless
            search = estimated(pruned(search, name, NO_SIZE, None))
            if others:
                _note_taken_up(search, name, set(others) - set(_sizeless(search)))
        else:
            return search


def _sizeless(search: Search) -> list[str]:
    """The causes whose numbers are too near to what was assumed to tell them from none, the nearest first."""
    if not search.fit.point.active:
        return []
    spread, causes = Spread.of(search), search.problem.causes
    away = {
        name: deviations(causes[name].effect, parameters(search, causes[name], spread))
        for name in search.fit.point.active
    }
    if len(away) == 1 and max(search.gains.values(), default=0.0) >= CLEAR:
        return []
    return sorted((name for name in away if away[name] < AWAY), key=lambda name: away[name])


def _note_taken_up(search: Search, gone: str, others: Collection[str]) -> None:
    """Note of what has a number once another one is gone, which neither had beside the other, that it may be
    that one in part: a gyro 1.0 +- 0.6 ms late beside a slip of 1.4 +- 1.0 ms was said to be 2.0 +- 0.2 ms
    late, and no slip."""
    for name in search.fit.point.active.keys() & others:
        known = [each for each in search.rivals.get(name, []) if each.name != gone]
        search.rivals[name] = [Rival(gone, 0.0, beside=True), *known]
