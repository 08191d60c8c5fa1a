"""Tests of other habits on one drive: its problem under each, the rejected ones, and searches that are
shared."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.search import run_search, start_selection
from raccoon.diagnose.select.state import Search, linearise_search, start_search
from raccoon.diagnose.select.transitions import refit_beside_unknown
from raccoon.diagnose.unknown.probes import make_probe_function
from raccoon.diagnose.unknown.step_change import KNOWN_CHANGE_LOG_EVIDENCE, change_name
from raccoon.sim.effects.chain import Chain

Trial = tuple[frozenset[str], frozenset[str], Habits, Habits]
"""The named causes, the unknown probes, the habits under which they were found, and the habits that were
tested."""
SearchAndHabits = tuple[Search, Habits]
"""A search and its habits."""
RunSearch = Callable[[Search], Search]
"""How far to continue a search: to its end (`run_search`), through its first part (`continue_selection`), or
its beginning (`start_selection`)."""
MAX_CACHED_STARTS = 4
"""Number of cached beginnings of searches, some ten megabytes each."""


@dataclass(frozen=True, slots=True)
class HabitTrials:
    """Tests of habits on one drive.

    problem_of: its problem under some habits. run_search: how far a search under other habits continues
    before it is compared. row_cycle: time in s between samples of a controller that takes one a row, see
    `sample_cycle_from_rows`. stops_unrecorded: whether motors are at duty 0 and the rows do not state whether
    they brake. rejected: tests whose fit did not lead; they are not repeated with the same causes. started:
    the latest beginnings of searches, by their habits. lags_of_robot: habits that were replaced because the
    robot's own lags explain as much.
    """

    problem_of: Callable[[Habits], Problem]
    run_search: RunSearch = run_search
    row_cycle: float = Chain().cycle
    stops_unrecorded: bool = False
    rejected: set[Trial] = field(default_factory=set)
    started: dict[Habits, Search] = field(default_factory=dict)
    lags_of_robot: set[Habits] = field(default_factory=set)

    def running(self, run_search: RunSearch) -> HabitTrials:
        """The same tests with searches that continue that far; both share what is recorded in either."""
        return replace(self, run_search=run_search)

    def start(self, habits: Habits, problem: Problem) -> Search:
        """The beginning of a search under habits, whose problem is given; computed once."""
        self.started[habits] = found = self.started.pop(habits, None) or start_selection(
            start_afresh(problem)
        )
        while len(self.started) > MAX_CACHED_STARTS:
            del self.started[next(iter(self.started))]
        return replace(
            found,
            leads=dict(found.leads),
            held_out_leads=dict(found.held_out_leads),
            rejections=dict(found.rejections),
            rivals={name: [*each] for name, each in found.rivals.items()},
        )

    def untried(self, search: Search, habits: Habits, others: Iterable[Habits]) -> list[Habits]:
        """Those of other habits that were not rejected with the present named causes."""
        return [each for each in others if _trial(search, habits, each) not in self.rejected]

    def reject(self, search: Search, habits: Habits, others: Iterable[Habits]) -> None:
        """Record that no fit under these other habits leads."""
        self.rejected.update(_trial(search, habits, each) for each in others)


def _trial(search: Search, habits: Habits, other: Habits) -> Trial:
    return frozenset(search.fit.point.active), frozenset(search.unknown), habits, other


def start_at(problem: Problem, point: Point, whitener: Whitener) -> Search:
    """A search from a fitted point, with the noise of an earlier search; a known change is part of its
    noise."""
    return linearise_search(problem, make_probe_function(problem), point, whitener, _known_change(problem))


def start_afresh(problem: Problem) -> Search:
    """A search from the base numbers alone; a known change is part of its noise."""
    search = start_search(problem, make_probe_function(problem))
    known = _known_change(problem)
    return refit_beside_unknown(search, known, search.fit.point) if known else search


def _known_change(problem: Problem) -> dict[str, float]:
    """The problem's known change as a part of the noise, with its log evidence; empty without one."""
    if problem.change is None:
        return {}
    return {change_name(problem.change): KNOWN_CHANGE_LOG_EVIDENCE}
