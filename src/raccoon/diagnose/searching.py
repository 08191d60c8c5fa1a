"""The search of a drive under the habits of the controller, and the form of slip, that fit it best.

Habits are found out before any cause is known, and what base numbers cannot do for a cause hides what a habit
does. So once causes are named what was found is fitted under the others too, and searched for again where one
of them leads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.fit import fit_point
from raccoon.diagnose.habits import another_chain, controller_of, drive_problem, with_lost_changes
from raccoon.diagnose.hypotheses import FORMS, Cause
from raccoon.diagnose.log import Log
from raccoon.diagnose.problem import Point, Problem
from raccoon.diagnose.rollout import Habits
from raccoon.diagnose.select.joint import explains_more
from raccoon.diagnose.select.outlook import Search
from raccoon.diagnose.select.refits import lag_as
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import search_causes
from raccoon.diagnose.select.sets import apart
from raccoon.diagnose.unknown import probes_for
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import Parameters

LATE, LATE_GYRO, SLIP = "actuation.latency", "imu.latency", "drive.wheel_slip"
LIKE_A_FILTER = (LATE, "bemf.filter_lag")
DOUBT = 10.0
"""Log evidence, gates counted, by which another filter than the firmware's must lead in the end."""
FAR_BEHIND = 100.0
"""By how much the firmware's may lack with the causes that were found under another, and be tried."""


def searched(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None
) -> tuple[Search, Habits, Log]:
    """The search, the habits that it is under, and the log with the changes of commands whose rows it lost.

    Commands that changed in lost rows are asked for again once causes are known: a limit of the current that
    is not known yet looks like a later change.
    """
    restored, habits = controller_of(log, robot, causes, model)
    search = _search_in(drive_problem(restored, robot, causes, habits, model))
    better = with_lost_changes(log, robot, causes, habits, model, search.fit.point)
    if not np.array_equal(better.time, restored.time):
        restored = better
        search = _search_in(drive_problem(restored, robot, causes, habits, model))
    other = replace(habits, chain=another_chain(habits.chain))
    found = _under_another_filter(search, drive_problem(restored, robot, causes, other, model), other)
    search, habits = (search, habits) if found is None else (found, other)
    if not restored.duty.all():
        other = replace(habits, brake=not habits.brake)
        found = _ahead(search, drive_problem(restored, robot, causes, other, model), [search.fit.point])
        search, habits = (search, habits) if found is None else (found, other)
    for chain in dict.fromkeys((habits.chain, Chain.firmware())):
        other = replace(habits, chain=chain, past=True)
        found = _with_past_commands(search, drive_problem(restored, robot, causes, other, model))
        if found is not None:
            return _with_the_slip_that_fits(found), other, restored
    return _with_the_slip_that_fits(search), habits, restored


def _ahead(
    search: Search, problem: Problem, starts: Sequence[Point], far: float = DOUBT, wanted: float = DOUBT
) -> Search | None:
    """The search of another problem, where one of these starts is ahead by `far` once it is fitted there, and
    then what was found by `wanted`."""
    whitener = search.whitener
    if max(net_lead(search, fit_point(problem, whitener, each), search.fit) for each in starts) < far:
        return None
    second = _search_in(problem)
    return second if explains_more(second, search) > wanted else None


def _under_another_filter(search: Search, problem: Problem, habits: Habits) -> Search | None:
    """The search under another filter, where that explains more.

    The firmware's may be the right one where a latency or a lag stands in for it, and need not be ahead
    before it has been searched under. A late gyro may be all that is commanded, under a filter that delays by
    as much less.
    """
    firmware = habits.chain == Chain.firmware()
    imitated = firmware and any(name.startswith(LIKE_A_FILTER) for name in search.fit.point.active)
    far, wanted = -FAR_BEHIND if imitated else DOUBT, -DOUBT if firmware else DOUBT
    return _ahead(search, problem, [search.fit.point, *_late_instead(search)], far, wanted)


def _with_past_commands(search: Search, problem: Problem) -> Search | None:
    """The search with commands that were in force until their rows, where that explains more.

    A logger that writes what it has just done makes every command seem late. Nothing in the catalogue is
    early: of robots without a fault it made a filter without a median, a latency of 3 ms and a gear that
    loses torque. Asked only where the robot of robot.toml, or that which was found, is nearer to the readings
    with such commands.
    """
    point, present = search.fit.point, search.problem
    starts = [point, point.without_cause(LATE), problem.nominal()]
    named = point.active or search.unknown
    if not named or all(_misfit(problem, search, each) > _misfit(present, search, each) for each in starts):
        return None
    return _ahead(search, problem, starts)


def _misfit(problem: Problem, search: Search, point: Point) -> float:
    white = search.whitener(problem.features.measured - problem.predict([point]))[0]
    return float(np.abs(white).sum())


def _late_instead(search: Search) -> list[Point]:
    """Where a search ended, with all that is commanded late instead of the gyro alone."""
    point, causes = search.fit.point, search.problem.causes
    if LATE_GYRO not in point.active or LATE not in causes or not apart(LATE, point.active):
        return []
    return [point.without_cause(LATE_GYRO).with_cause(LATE, lag_as(search, LATE_GYRO, LATE))]


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


def _search_in(problem: Problem) -> Search:
    return search_causes(problem, probes_for(problem))
