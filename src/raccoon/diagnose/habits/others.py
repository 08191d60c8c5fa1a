"""What a search found, looked at under other habits of the controller and the gears.

Habits are found out before any cause is known, and what base numbers cannot do for a cause hides what a habit
does. So what was found is fitted under others too, and searched for again where one of them leads.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.doing import tell
from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.fitting import fit_at, fit_many, fit_point
from raccoon.diagnose.fit.problem import Point, Problem, carried, carried_columns
from raccoon.diagnose.habits.chains import CHAINS
from raccoon.diagnose.habits.controller import QUICK_BATTERY, SLOW_BATTERY, battery_off, with_battery
from raccoon.diagnose.hypotheses.base_coordinates import Wheels
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.alternative_sets import explains_more
from raccoon.diagnose.select.gates import CROWDED
from raccoon.diagnose.select.refits import SEVERAL
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import begun, beside_unknown, finished, grown_on, whole
from raccoon.diagnose.select.state import Search, start_search
from raccoon.diagnose.unknown.probes import make_probe_function
from raccoon.diagnose.unknown.step_change import KNOWN_CHANGE_LOG_EVIDENCE, change_name

Array = NDArray[np.float64]
Asked = tuple[frozenset[str], frozenset[str], Habits, Habits]
Onward = Callable[[Search], Search]
"""How far to go on with a search: all the way, its first part (`grown_on`), or the beginning (`begun`)."""
LATE, SAG = "actuation.latency", "battery.internal_resistance"
DOUBT = 10.0
"""Log evidence, gates counted, by which another filter than the firmware's must lead in the end."""
ROUGH_STEPS = 8
"""Of a fit that says which of several starts is the likeliest."""
AGAIN = "searching again as another controller or gear would have it"
LOST, FORETOLD = 150.0, 4.0
"""Log evidence that a fit lacks, also after so many times what its next step is foretold to gain, when it is
given up; what a habit may lack in the end is a hundred."""
MOST_KEPT = 4
"""Beginnings of searches that are kept, some ten megabytes each."""


@dataclass(frozen=True, slots=True)
class Under:
    """The problem of a drive under some habits.

    vain: what was named and unknown under which habits, when no fit under which others was ahead; they are
    not asked for again with the same. beginnings: the latest searches from their start, as far as one begins.
    left: habits whose lags are the robot's.
    """

    problem_of: Callable[[Habits], Problem]
    vain: set[Asked] = field(default_factory=set)
    beginnings: dict[Habits, Search] = field(default_factory=dict)
    left: set[Habits] = field(default_factory=set)

    def __call__(self, habits: Habits) -> Problem:
        return self.problem_of(habits)

    def forget(self) -> None:
        """What was found out, once the drive is another."""
        for each in (self.vain, self.beginnings, self.left):
            each.clear()

    def beginning(self, habits: Habits, problem: Problem) -> Search:
        """The beginning of a search from its start under habits, whose problem this is: the same for whoever
        asks."""
        self.beginnings[habits] = found = self.beginnings.pop(habits, None) or begun(started(problem))
        while len(self.beginnings) > MOST_KEPT:
            del self.beginnings[next(iter(self.beginnings))]
        return replace(
            found,
            gains=dict(found.gains),
            held_out=dict(found.held_out),
            failed=dict(found.failed),
            rivals={name: [*each] for name, each in found.rivals.items()},
        )

    def new(self, search: Search, habits: Habits, others: Iterable[Habits]) -> list[Habits]:
        """Those of other habits that were not asked for in vain with what is named."""
        return [each for each in others if _asked(search, habits, each) not in self.vain]

    def were_vain(self, search: Search, habits: Habits, others: Iterable[Habits]) -> None:
        """Note that no fit under these others is ahead."""
        self.vain.update(_asked(search, habits, each) for each in others)


def _asked(search: Search, habits: Habits, other: Habits) -> Asked:
    return frozenset(search.fit.point.active), frozenset(search.unknown), habits, other


def started(problem: Problem) -> Search:
    """A search of what robot.toml leaves open alone; what is known to have changed is beside it."""
    search = start_search(problem, make_probe_function(problem))
    if problem.change is None:
        return search
    return beside_unknown(search, {change_name(problem.change): KNOWN_CHANGE_LOG_EVIDENCE}, search.fit.point)


def best_of(search: Search, problem: Problem, starts: Sequence[Point]) -> Fit:
    """The likeliest, gates counted, of these starts once they are fitted in another problem: with the columns
    that base numbers have at the first, and that one with its own. One start goes with those that it has in
    the search for a while. One that is far behind is left where it is."""
    whitener, there = search.whitener, [carried(each, search.problem, problem) for each in starts]

    def lost(fit: Fit, foretold: float) -> bool:
        gained = 0.5 * FORETOLD * foretold
        hopeless = fit.evidence + gained < search.fit.evidence - LOST
        return hopeless and net_lead(search, fit, search.fit) < -LOST

    if len(there) > 1:
        columns = fit_at(problem, whitener, there[0]).jacobian[: len(problem.base)]
        rough = fit_many(problem, whitener, there, columns, ROUGH_STEPS, lost)
        there = [max(rough, key=lambda each: net_lead(search, each, search.fit)).point]
    elif (known := carried_columns(search.fit.jacobian, search.problem, problem)) is not None:
        if list(there[0].active) != list(search.fit.point.active):
            known = known[: len(problem.base)]
        (first,) = fit_many(problem, whitener, there, known, ROUGH_STEPS, lost)
        if lost(first, 0.0):
            return first
        there = [first.point]
    return fit_point(problem, whitener, there[0], lost=lost)


def leads(search: Search, problem: Problem, starts: Sequence[Point]) -> float:
    """Log evidence, gates counted, by which that one is ahead."""
    return net_lead(search, best_of(search, problem, starts), search.fit)


def again(search: Search, problem: Problem) -> Search | None:
    """The whole search of another problem, where what was found there is ahead."""
    second = _gone_on_unless_behind(begun(started(problem)), search, 0.0, whole)
    return second if second is not None and explains_more(second, search) > DOUBT else None


def if_ahead(
    search: Search,
    habits: Habits,
    under: Under,
    other: Habits,
    problem: Problem,
    starts: Sequence[Point],
    far: float = DOUBT,
    wanted: float = DOUBT,
    by: Onward = whole,
) -> tuple[Search, Habits]:
    """The search under other habits, whose problem this is, where one of these starts is ahead by `far` there
    and then what was found by `wanted`; else the search as it is.

    Where nothing is wrong under the others they need not be ahead by more than 0: that a wheel slides in
    another way than was thought is no less likely than a fault."""
    fit = best_of(search, problem, starts)
    ahead = net_lead(search, fit, search.fit)
    if ahead < far:
        under.were_vain(search, habits, [other])
        return search, habits
    second = _gone_on_unless_behind(under.beginning(other, problem), search, min(wanted, 0.0), by)
    if second is None:
        under.were_vain(search, habits, [other])
        return search, habits
    if sound(second) and not sound(search):
        wanted = min(wanted, 0.0)
    more = explains_more(second, search)
    if second.fit.point.active.keys() == fit.point.active.keys():
        # What was fitted under less noise is no best fit under more: one that was ahead by 75 lacked 46.
        more = max(more, ahead)
    return (second, other) if more > wanted else (search, habits)


def sound(search: Search) -> bool:
    """Whether nothing is named, and nothing unknown."""
    return not (search.fit.point.active or search.unknown)


def _gone_on_unless_behind(first: Search, search: Search, wanted: float, by: Onward) -> Search | None:
    """A search that has begun, as far as one goes; None where it is behind another on the way."""
    tell(AGAIN)
    if by is begun:
        return first
    if _ended_behind(first, search, wanted):
        return None
    second = grown_on(first)
    if _grown_behind(second, search):
        return None
    return finished(second) if by is whole else second


def _ended_behind(second: Search, search: Search, wanted: float) -> bool:
    """Whether a search that has only begun ended with the causes that are named already, far from what is
    wanted: going on from these found nothing better under the habits that they were found under."""
    named, there = search.fit.point.active, second.fit.point.active
    same = set(named) == set(there) and set(search.unknown) == set(second.unknown)
    return same and len(there) < SEVERAL and explains_more(second, search) < wanted - DOUBT


def _grown_behind(second: Search, search: Search) -> bool:
    """Whether a search that has grown beside a crowd of causes explains less, with a crowd as well or far
    less: what other habits do not make simpler is no sign of them, and the rest of such a search takes
    longest."""
    named, there = search.fit.point.active, second.fit.point.active
    if len(named) < CROWDED:
        return False
    return explains_more(second, search) < (0.0 if len(there) >= CROWDED else -LOST)


def first_ahead(
    search: Search,
    habits: Habits,
    others: Sequence[Habits],
    under: Under,
    by: Onward = whole,
    far: float = DOUBT,
) -> tuple[Search, Habits]:
    """The search under the nearest of other habits that explains more, or as it is. far: see `if_ahead`."""
    asked = under.new(search, habits, [each for each in others if each != habits])
    near = _nearer(search, asked, under)
    under.were_vain(search, habits, (each for each in asked if each not in near))
    for other, problem in near.items():
        found, now = if_ahead(search, habits, under, other, problem, _starts(search), far, by=by)
        if now != habits:
            return found, now
    return search, habits


def as_wheels_give(search: Search, habits: Habits, under: Under, by: Onward = whole) -> tuple[Search, Habits]:
    """The search with wheels that slide in another way, where that explains more.

    Rigid wheels among those that give were a robot of five times the resistance, a fifth of the inertia and
    little friction: the same drive, in which what gives is stiffer.
    """
    others = [replace(habits, wheels=each) for each in Wheels if each is not habits.wheels]
    return first_ahead(search, habits, others, under, by)


def with_a_slow_battery(
    search: Search, habits: Habits, under: Under, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search with another filter of the battery's readings, where that explains more.

    RaccoonOS adds one of 0.1 s; of a robot without a fault that made a battery of no resistance, and
    something unknown. The firmware's own is asked for under other filters of the wheels' readings as well:
    a resistance 13 % high and a slip of 3 ms were named of a sound robot 105 behind it.
    """
    if habits.knows_battery or "battery" not in search.problem.features.roles:
        return search, habits
    usual = (each.battery_time_constant for each in CHAINS)
    times = dict.fromkeys((*usual, *QUICK_BATTERY, *SLOW_BATTERY))
    others = [each for each in (with_battery(habits, time) for time in times) if each != habits]
    if len(under.new(search, habits, others)) < len(others):
        return search, habits
    near = _nearer(search, others, under)
    if not near:
        under.were_vain(search, habits, others)
        return search, habits
    likeliest = by_the_battery(search, near, _starts(search))
    return if_ahead(search, habits, under, likeliest, near[likeliest], _starts(search), by=by)


def by_the_battery(search: Search, near: Mapping[Habits, Problem], starts: Sequence[Point]) -> Habits:
    """Of habits, with their problems, those from which the battery's readings are least off."""
    there = {own: [carried(each, search.problem, its) for each in starts] for own, its in near.items()}
    return min(near, key=lambda each: battery_off(near[each], there[each]))


def without(point: Point, names: Collection[str]) -> Point:
    """A point without these causes."""
    return replace(point, active={name: u for name, u in point.active.items() if name not in names})


def _nearer(search: Search, others: Sequence[Habits], under: Under) -> dict[Habits, Problem]:
    """The other habits, with their problems, by which robot.toml's robot, or what was found, is nearer to the
    readings; the nearest first. Known causes are far worse with them than with theirs, and where nothing was
    named nobody asks."""
    if sound(search):
        return {}
    present = _misfits(search, search.problem)
    problems = {each: under(each) for each in others}
    misfits = {each: _misfits(search, its) for each, its in problems.items()}
    near = [each for each in others if (misfits[each] < present).any()]
    return {each: problems[each] for each in sorted(near, key=lambda each: misfits[each].min())}


def _starts(search: Search) -> list[Point]:
    """What was found, without what another logger is most likely to have been taken for, and robot.toml."""
    point = search.fit.point
    less = [point.without_cause(each) for each in (LATE, SAG) if each in point.active]
    return [point, *less, search.problem.nominal()]


def _misfits(search: Search, problem: Problem) -> Array:
    """Of each start, (starts,)."""
    starts = [carried(each, search.problem, problem) for each in _starts(search)]
    white = search.whitener(problem.features.measured - problem.predict(starts))
    return np.asarray(np.abs(white).sum(axis=-1), float)
