"""The search of a drive under the habits of the controller, and the form of slip, that fit it best.

Habits are found out before any cause is known, and what base numbers cannot do for a cause hides what a habit
does. So once causes are named what was found is fitted under the others too, and searched for again where one
of them leads.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.fit import fit_point
from raccoon.diagnose.habits import (
    controller_of,
    drive_problem,
    other_chains,
    usual_chain,
    with_lost_changes,
)
from raccoon.diagnose.hypotheses import FORMS, Cause, Wheels
from raccoon.diagnose.log import Log
from raccoon.diagnose.problem import Point, Problem
from raccoon.diagnose.rollout import Habits
from raccoon.diagnose.select.joint import explains_more
from raccoon.diagnose.select.outlook import Search
from raccoon.diagnose.select.refits import lag_as
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import begun, finished, search_causes
from raccoon.diagnose.select.sets import apart
from raccoon.diagnose.unknown import probes_for
from raccoon.diagnose.watch import tell
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import Parameters

Array = NDArray[np.float64]
Way = Callable[[Problem], Search]
"""How to search: all the way, or its beginning."""

LATE, LATE_GYRO, SLIP = "actuation.latency", "imu.latency", "drive.wheel_slip"
SAG = "battery.internal_resistance"
SLOW_BATTERY = (0.05, 0.1, 0.2, 0.4)
"""s, of filters of the battery's reading that are tried."""
LIKE_A_FILTER = (LATE, "bemf.filter_lag")
DOUBT = 10.0
"""Log evidence, gates counted, by which another filter than the firmware's must lead in the end."""
FAR_BEHIND = 100.0
"""By how much the firmware's may lack with the causes that were found under another, and be tried."""


def _begun_in(problem: Problem) -> Search:
    return begun(problem, probes_for(problem))


def _search_in(problem: Problem) -> Search:
    return search_causes(problem, probes_for(problem))


def searched(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None
) -> tuple[Search, Habits, Log]:
    """The search, the habits that it is under, and the log with the changes of commands whose rows it lost.

    Commands that changed in lost rows are asked for again once causes are known: a limit of the current that
    is not known yet looks like a later change.
    """
    tell("finding out what the controller does with its samples")
    restored, habits = controller_of(log, robot, causes, model)

    def under(each: Habits) -> Problem:
        return drive_problem(restored, robot, causes, each, model)

    begin, habits = _sooner(_begun_in(under(habits)), habits, under)
    search = finished(begin)
    better = with_lost_changes(log, robot, causes, habits, model, search.fit.point)
    if not np.array_equal(better.time, restored.time):
        restored = better
        search = _search_in(under(habits))
    for chain in other_chains(habits.chain):
        other = replace(habits, chain=chain)
        found = _under_another_filter(search, under(other), other)
        search, habits = (search, habits) if found is None else (found, other)
    search, habits = _as_wheels_give(search, habits, under)
    if not restored.duty.all():
        other = replace(habits, brake=not habits.brake)
        found = _ahead(search, under(other), [search.fit.point])
        search, habits = (search, habits) if found is None else (found, other)
    search, habits = _as_logged(search, habits, under)
    return _with_the_slip_that_fits(search), habits, restored


def _sooner(search: Search, habits: Habits, under: Callable[[Habits], Problem]) -> tuple[Search, Habits]:
    """A search that has only begun, begun again under what a whole one would find out about wheels and
    battery: under wrong habits most of its time goes to sets of causes that are not there."""
    search, habits = _as_wheels_give(search, habits, under, _begun_in)
    return _with_a_slow_battery(search, habits, under, _begun_in)


def _ahead(
    search: Search,
    problem: Problem,
    starts: Sequence[Point],
    far: float = DOUBT,
    wanted: float = DOUBT,
    by: Way = _search_in,
) -> Search | None:
    """The search of another problem, where one of these starts is ahead by `far` once it is fitted there, and
    then what was found by `wanted`. by: how to search."""
    whitener, there = search.whitener, [carried(each, search.problem, problem) for each in starts]
    if max(net_lead(search, fit_point(problem, whitener, each), search.fit) for each in there) < far:
        return None
    tell("searching again as another controller or gear would have it")
    second = by(problem)
    return second if explains_more(second, search) > wanted else None


def carried(point: Point, here: Problem, there: Problem) -> Point:
    """A point in another problem, whose base coordinates may be fewer or more."""
    known = dict(zip((each.settings for each in here.base), point.base, strict=True))
    return replace(point, base=np.array([known.get(each.settings, 0.0) for each in there.base]))


def _as_wheels_give(
    search: Search, habits: Habits, under: Callable[[Habits], Problem], by: Way = _search_in
) -> tuple[Search, Habits]:
    """The search with wheels that slide in another way, where that explains more.

    Rigid wheels among those that give were a robot of five times the resistance, a fifth of the inertia and
    little friction: the same drive, in which what gives is stiffer.
    """
    others = [replace(habits, wheels=each) for each in Wheels if each is not habits.wheels]
    return _first_ahead(search, habits, others, under, by)


def _under_another_filter(search: Search, problem: Problem, habits: Habits) -> Search | None:
    """The search under another filter, where that explains more.

    The firmware's may be the right one where a latency or a lag stands in for it, and need not be ahead
    before it has been searched under. A late gyro may be all that is commanded, under a filter that delays by
    as much less, and a latency of a sample the gyro alone under a median.
    """
    firmware = usual_chain(habits.chain) == Chain.firmware()
    imitated = firmware and any(name.startswith(LIKE_A_FILTER) for name in search.fit.point.active)
    far, wanted = -FAR_BEHIND if imitated else DOUBT, -DOUBT if firmware else DOUBT
    late, gyro = _lags_instead(search, LATE_GYRO, (LATE,)), _lags_instead(search, LATE, (LATE_GYRO, SLIP))
    return _ahead(search, problem, [search.fit.point, *late, *gyro], far, wanted)


def _as_logged(search: Search, habits: Habits, under: Callable[[Habits], Problem]) -> tuple[Search, Habits]:
    """The search under what else writes logs, where that explains more: something that follows the battery
    more slowly, or that writes what it has just done.

    Commands in the row after theirs seem early, as nothing in the catalogue is; that made a filter without a
    median, a latency of 3 ms and a gear that loses torque.
    """
    search, habits = _with_a_slow_battery(search, habits, under)
    firmware = replace(Chain.firmware(), battery_time_constant=habits.chain.battery_time_constant)
    past = [replace(habits, chain=chain, past=True) for chain in dict.fromkeys((habits.chain, firmware))]
    return _first_ahead(search, habits, past, under)


def _with_a_slow_battery(
    search: Search, habits: Habits, under: Callable[[Habits], Problem], by: Way = _search_in
) -> tuple[Search, Habits]:
    """The search with another filter of the battery's readings, where that explains more.

    RaccoonOS adds one of 0.1 s; of a robot without a fault that made a battery of no resistance, and
    something unknown.
    """
    if "battery" not in search.problem.features.roles:
        return search, habits
    chain = habits.chain
    times = (usual_chain(chain).battery_time_constant, *SLOW_BATTERY)
    chains = [replace(chain, battery_time_constant=each) for each in times]
    near = _nearer(search, [replace(habits, chain=each) for each in chains if each != chain], under)
    if near:
        likeliest = min(near, key=lambda each: _battery_off(near[each], _starts(search)))
        found = _ahead(search, near[likeliest], _starts(search), by=by)
        search, habits = (search, habits) if found is None else (found, likeliest)
    return search, habits


def _first_ahead(
    search: Search,
    habits: Habits,
    others: Sequence[Habits],
    under: Callable[[Habits], Problem],
    by: Way = _search_in,
) -> tuple[Search, Habits]:
    """The search under the nearest of other habits that explains more, or as it is."""
    for other, problem in _nearer(search, others, under).items():
        found = _ahead(search, problem, _starts(search), by=by)
        if found is not None:
            return found, other
    return search, habits


def _nearer(
    search: Search, others: Sequence[Habits], under: Callable[[Habits], Problem]
) -> dict[Habits, Problem]:
    """The other habits, with their problems, by which robot.toml's robot, or what was found, is nearer to the
    readings; the nearest first. Known causes are far worse with them than with theirs, and where nothing was
    named nobody asks."""
    if not (search.fit.point.active or search.unknown):
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


def _battery_off(problem: Problem, starts: Sequence[Point]) -> float:
    """By how much the battery's reading is off at best, its resistance and voltage as suit it."""
    index, sizes = problem.features.roles.index("battery"), []
    measured = problem.features.measured[:, index]
    for each in problem.predict(starts)[..., index]:
        columns = np.stack([np.ones_like(each), each], axis=1)
        factors, *_ = np.linalg.lstsq(columns, measured, rcond=None)
        sizes.append(float(np.abs(measured - columns @ factors).mean()))
    return min(sizes)


def _lags_instead(search: Search, name: str, others: Sequence[str]) -> list[Point]:
    """Where a search ended, each time with another of these lags instead of a named one."""
    point = search.fit.point
    if name not in point.active:
        return []
    less = point.without_cause(name)
    asked = [each for each in others if each in search.problem.causes and apart(each, less.active)]
    return [less.with_cause(each, lag_as(search, name, each)) for each in asked]


def _with_the_slip_that_fits(search: Search) -> Search:
    """The search, or that with slip which follows acceleration at once, where that explains more: to a lag
    it looks like a gyro that is late."""
    point, causes = search.fit.point, search.problem.causes
    late = [name for name in (LATE_GYRO, SLIP) if name in point.active]
    if not late or SLIP not in causes:
        return search
    start = point
    for name in late:
        start = start.without_cause(name)
    if not apart(SLIP, start.active):  # one wheel's slip was named
        return search
    start = start.with_cause(SLIP, np.sum([lag_as(search, name, SLIP) for name in late], axis=0))
    at_once = {key: 1.0 for key in search.problem.neutral if key[::2] == (SLIP, FORMS[SLIP])}
    second = _ahead(search, replace(search.problem, neutral=search.problem.neutral | at_once), [start])
    return search if second is None or SLIP not in second.fit.point.active else second
