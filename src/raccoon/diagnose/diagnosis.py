"""From a recording to a diagnosis: the whole way in one place."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.extend import extended
from raccoon.diagnose.fit import fit_point
from raccoon.diagnose.gain import HeldOut, held_out
from raccoon.diagnose.habits import another_chain, controller_of, drive_problem, with_lost_changes
from raccoon.diagnose.hypotheses import FORMS, Cause
from raccoon.diagnose.log import Log, log_from_columns
from raccoon.diagnose.naming import named_causes, rejections, suggestions
from raccoon.diagnose.noise import whiteness
from raccoon.diagnose.problem import Point, Problem
from raccoon.diagnose.quality import check_units, moves
from raccoon.diagnose.result import ChannelResult, Curve, Diagnosis, Unexplained, Verdict
from raccoon.diagnose.rollout import Habits
from raccoon.diagnose.select.joint import explains_more
from raccoon.diagnose.select.outlook import Search, estimated
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import pruned, search_causes
from raccoon.diagnose.select.sets import apart
from raccoon.diagnose.shapes import shapes_of
from raccoon.diagnose.spread import Spread
from raccoon.diagnose.unknown import PREFIX, probes_for
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

LARGE_REST = 0.3
LATE, LATE_GYRO, SLIP = "actuation.latency", "imu.latency", "drive.wheel_slip"
LIKE_A_FILTER = (LATE, "bemf.filter_lag")
DOUBT = 10.0
"""Log evidence, gates counted, by which another filter than the firmware's must lead in the end."""
FAR_BEHIND = 100.0
"""By how much the firmware's may lack with the causes that were found under another, and be tried."""
CLEAR = 25.0
"""Log evidence from which a cause stands whatever its error on unseen data, which one event can spoil."""
HARM = 0.9
"""Error on unseen data without a cause, over that with it, at which the cause is dropped."""


def diagnose(
    columns: Columns,
    robot: RobotConfig,
    *,
    holdout: Columns | None = None,
    causes: Sequence[Cause] | None = None,
    model: Parameters | None = None,
) -> Diagnosis:
    """Say what the simulation of `robot` gets wrong in a recording, and why.

    columns: the recording by names of the CSV format, NaN where a sensor had nothing new. robot: ports and
    nominal model; its standard deviations are how far each number may be off without being a cause. holdout:
    another recording of the same robot to judge on. causes: hypotheses to consider, by default the whole
    catalogue of drives; `own` says how to add your own. model: a simulation to start from, with effects that
    are already known, instead of the nominal one.

    Raises TraceError for a recording that cannot be used: empty, too short, time that does not advance,
    columns in wrong units, no commands, another robot's ports.
    """
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

    begin = time.perf_counter()
    log = log_from_columns(columns, robot)
    check_units(log, robot)
    with threadpool_limits(
        1
    ):  # the matrices are small: threads that wait for each other cost more than they do
        if not moves(log):
            return _nothing_to_see(begin)
        tried = tuple(drive_causes() if causes is None else causes)
        search, habits, log = _searched(log, robot, tried, model)
        search = _with_the_slip_that_fits(search)
        other = None
        if holdout is not None:
            other_log = log_from_columns(holdout, robot)
            check_units(other_log, robot)
            other_log = with_lost_changes(other_log, robot, tried, habits, model, search.fit.point)
            other = drive_problem(other_log, robot, tried, habits, model)
            other = replace(other, neutral=search.problem.neutral)
        search, judged = _proven(search, other)
        return _diagnosis(log, search, judged, habits, begin)


def _searched(
    log: Log, robot: RobotConfig, causes: Sequence[Cause], model: Parameters | None
) -> tuple[Search, Habits, Log]:
    """The search under the habits that fit best, and under another filter where that may be the controller's;
    and the log with the changes of commands whose rows it lost.

    Habits are found out before any cause is known, and what base numbers cannot do for a cause hides what a
    filter does: so what was found is fitted under the other one too, and what that makes of a late gyro. The
    firmware's may be the right one where a latency or a lag stands in for it, and need not be ahead before it
    has been searched under.
    Commands that changed in lost rows are asked for again as well: a limit of the current that is not known
    yet looks like a later change.
    """
    restored, habits = controller_of(log, robot, causes, model)
    search = _search_in(drive_problem(restored, robot, causes, habits, model))
    better = with_lost_changes(log, robot, causes, habits, model, search.fit.point)
    if not np.array_equal(better.time, restored.time):
        restored = better
        search = _search_in(drive_problem(restored, robot, causes, habits, model))
    other = replace(habits, chain=another_chain(habits.chain))
    again = drive_problem(restored, robot, causes, other, model)
    starts = _under_another_filter(search)
    ahead = max(net_lead(search, fit_point(again, search.whitener, each), search.fit) for each in starts)
    firmware = other.chain == Chain.firmware()
    imitated = firmware and any(name.startswith(LIKE_A_FILTER) for name in search.fit.point.active)
    if ahead < (-FAR_BEHIND if imitated else DOUBT):
        return search, habits, restored
    second = _search_in(again)
    wanted = -DOUBT if firmware else DOUBT
    if explains_more(second, search) > wanted:
        return second, other, restored
    return search, habits, restored


def _under_another_filter(search: Search) -> list[Point]:
    """Where a search ended, and the same with all that is commanded late instead of the gyro alone: under a
    filter that delays by as much less, a late gyro was that."""
    point, causes = search.fit.point, search.problem.causes
    starts = [point]
    if LATE_GYRO in point.active and apart(LATE, point.active) and LATE in causes:
        (gyro,), (all_,) = causes[LATE_GYRO].coordinates, causes[LATE].coordinates
        u = point.active[LATE_GYRO] * gyro.value(1.0) / all_.value(1.0)
        starts.append(point.without_cause(LATE_GYRO).with_cause(LATE, u))
    return starts


def _with_the_slip_that_fits(search: Search) -> Search:
    """The search, or that with slip which follows acceleration at once, where that explains more: to a lag
    it looks like a gyro that is late."""
    point, causes = search.fit.point, search.problem.causes
    late = [name for name in (LATE_GYRO, SLIP) if name in point.active]
    if not late or SLIP not in causes:
        return search
    seconds = sum(causes[name].coordinates[0].value(float(point.active[name][0])) for name in late)
    start = point
    for name in late:
        start = start.without_cause(name)
    start = start.with_cause(SLIP, np.array([seconds / causes[SLIP].coordinates[0].value(1.0)]))
    at_once = {key: 1.0 for key in search.problem.neutral if key[::2] == (SLIP, FORMS[SLIP])}
    problem = replace(search.problem, neutral=search.problem.neutral | at_once)
    if net_lead(search, fit_point(problem, search.whitener, start), search.fit) < DOUBT:
        return search
    second = _search_in(problem)
    return second if SLIP in second.fit.point.active and explains_more(second, search) > DOUBT else search


def _search_in(problem: Problem) -> Search:
    return search_causes(problem, probes_for(problem))


def _proven(search: Search, other: Problem | None) -> tuple[Search, HeldOut]:
    """The causes that stand on unseen data, and how they do there."""
    search = estimated(search)
    judged = held_out(search, other)
    while len(search.fit.point.active) > 1:
        weak = [name for name in search.fit.point.active if search.gains.get(name, CLEAR) < CLEAR]
        weak.sort(key=lambda name: judged.without[name])
        if not weak or judged.without[weak[0]] > HARM * judged.size_after:
            break
        search = estimated(pruned(search, weak[0]))
        judged = held_out(search, other)
    return search, judged


def _nothing_to_see(begin: float) -> Diagnosis:
    note = "the commands never change, or no wheel answers them: drive, turn and stop while recording"
    return Diagnosis(
        Verdict.NOT_IDENTIFIABLE,
        (),
        (),
        (),
        Unexplained(0.0),
        (note,),
        time.perf_counter() - begin,
        None,
        (note,),
    )


def _diagnosis(log: Log, search: Search, judged: HeldOut, habits: Habits, begin: float) -> Diagnosis:
    spread = Spread.of(search)
    causes = named_causes(search, judged, spread)
    depends_on = tuple(each.removeprefix(PREFIX) for each in search.unknown)
    left = judged.left if judged.is_far else 0.0  # what chance makes is no part of it
    verdict = _verdict(not all(each.little for each in causes), bool(depends_on), left, judged.is_far)
    white = search.whitener(search.linear.residual[None])[0].reshape(search.linear.residual.shape)
    return Diagnosis(
        verdict,
        _channels(log, judged, whiteness(white)),
        causes,
        rejections(search, log),
        Unexplained(left, depends_on),
        suggestions(search, causes, log),
        time.perf_counter() - begin,
        extended(search.problem, spread, causes, habits.chain),
        (*log.notes, *_not_in_model(search)),
        curves=_curves(log, judged),
        shapes=shapes_of(search),
    )


def _not_in_model(search: Search) -> tuple[str, ...]:
    """What the simulator cannot be told in a model.toml."""
    own = [name for name in search.fit.point.active if search.problem.causes[name].own is not None]
    return tuple(f"{name} is Python of yours: a model.toml does not hold it" for name in own)


def _curves(log: Log, judged: HeldOut) -> tuple[Curve, ...]:
    """Every channel on data that was not fitted, for pictures."""
    measured, (before, after) = judged.measured, judged.residual
    return tuple(
        Curve(
            each.name,
            each.unit,
            judged.time,
            measured[:, index],
            (measured - before)[:, index],
            (measured - after)[:, index],
        )
        for index, each in enumerate(log.channels)
    )


def _verdict(causes: bool, unknown: bool, left: float, is_far: bool) -> Verdict:
    """causes: whether any that matters was named. left: as `HeldOut` has it, of what is beyond chance."""
    if unknown:
        return Verdict.PARTLY if causes else Verdict.UNKNOWN
    if not causes:
        return Verdict.UNKNOWN if is_far else Verdict.ADEQUATE
    return Verdict.EXPLAINED if left < LARGE_REST else Verdict.PARTLY


def _channels(log: Log, judged: HeldOut, p_values: Array) -> tuple[ChannelResult, ...]:
    return tuple(
        ChannelResult(
            each.name,
            each.unit,
            float(judged.before[index]),
            float(judged.after[index]),
            float(judged.floor[index]),
            float(p_values[index]),
        )
        for index, each in enumerate(log.channels)
    )
