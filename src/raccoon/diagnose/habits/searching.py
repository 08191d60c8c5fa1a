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
from raccoon.core.doing import tell
from raccoon.diagnose.drives.driven import swing
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.habits.chains import (
    AT_ITS_END,
    PAUSING,
    as_it_pauses,
    cycle_of_samples,
    other_chains,
    pauses,
    reads_back_emf,
    usual_chain,
    with_driver_of,
)
from raccoon.diagnose.habits.controller import controller_of, cycle_by_row
from raccoon.diagnose.habits.cycles import (
    as_pauses_slow_the_wheels,
    as_pauses_slow_the_wheels_beside,
    as_rows_are_made,
    as_the_filter_runs,
)
from raccoon.diagnose.habits.driver import as_a_deadband_ends, with_whole_currents
from raccoon.diagnose.habits.lags import (
    LATE_GYRO,
    SLIP,
    as_lags_of_the_robot,
    lags_instead,
    left_to_the_firmware,
    or_a_smooth_gyro,
    or_another,
    with_readings_that_lag,
)
from raccoon.diagnose.habits.others import (
    DOUBT,
    LATE,
    Onward,
    Under,
    again,
    as_wheels_give,
    first_ahead,
    if_ahead,
    leads,
    sound,
    started,
    with_a_slow_battery,
    without,
)
from raccoon.diagnose.habits.problems import drive_problem, with_lost_changes
from raccoon.diagnose.habits.within_rows import as_commanded
from raccoon.diagnose.hypotheses.base_coordinates import LOW_PASS
from raccoon.diagnose.hypotheses.coordinates import FORMS, Cause
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.refits import SCALE, SEVERAL, lag_as
from raccoon.diagnose.select.search import begun, finished, grown_on, whole
from raccoon.diagnose.select.set_scoring import apart
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters

LIKE_A_FILTER = (LATE, "bemf.filter_lag")
FAR_BEHIND = 100.0
"""By how much the firmware's may lack with the causes that were found under another, and be tried."""


def searched(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None = None,
) -> tuple[Search, Habits, Log]:
    """The search, the habits that it is under, and the log with the changes of commands whose rows it lost.

    firmware: the controller's, whose habits are not asked for then.

    Commands that changed in lost rows are asked for again once causes are known: a limit of the current that
    is not known yet looks like a later change. Where commands swing and one cause is not all, what is in the
    swings is not compared: a loop that hears of a push before the wheels' readings do has had several causes
    of a robot without any.
    """
    tell("finding out what the controller does with its samples")
    log, found = (log, None) if firmware else as_commanded(log, robot, causes, model)
    restored, first = controller_of(log, robot, causes, model, firmware, found)

    under = Under(lambda each: drive_problem(restored, robot, causes, each, model))
    by_row = first.chain.cycle if firmware else cycle_by_row(restored)
    search, habits = _sooner(begun(started(under(first))), first, under, by_row)
    if len(search.named) > 1 and (seconds := swing(log)):
        tell("comparing over whole swings of the commands")
        first = replace(first, swing=seconds)
        search, habits = _sooner(begun(started(under(first))), first, under, by_row)
    search, habits = _grown(search, habits, under)
    search = finished(search)
    better = with_lost_changes(log, robot, causes, habits, model, search.fit.point)
    if not np.array_equal(better.time, restored.time):
        restored = better
        under.forget()
        search = whole(started(under(habits)))
    search, habits = _under_another_filter(search, habits, under)
    search, habits = as_wheels_give(search, habits, under)
    if restored.brake is None and not restored.duty.all():
        search, habits = _braking(search, habits, under)
    search, habits = _as_logged(search, habits, under)
    search, habits = as_lags_of_the_robot(search, habits, under)
    search, habits = _with_the_slip_that_fits(search, habits, under)
    search = left_to_the_firmware(search, habits)
    search, habits = or_a_smooth_gyro(search, habits, under)
    return search, habits, restored


def _sooner(search: Search, habits: Habits, under: Under, by_row: float) -> tuple[Search, Habits]:
    """A search that has only begun, begun again under what a whole one would find out about wheels and
    filters: under wrong habits most of its time goes to sets of causes that are not there.

    The battery's filter comes before the wheels': where it is wrong, another of theirs may suit by chance.
    by_row: see `cycle_by_row`."""
    search, habits = as_wheels_give(search, habits, under, begun)
    if habits.firmware is not None:
        return with_a_slow_battery(search, habits, under, begun)
    search, habits = as_rows_are_made(search, habits, under, by_row, begun)
    search, habits = as_a_deadband_ends(search, habits, under, begun)
    search, habits = with_whole_currents(search, habits, under, begun)
    search, habits = with_a_slow_battery(search, habits, under, begun)
    search, habits = _under_another_filter(search, habits, under, begun)
    search, habits = as_the_filter_runs(search, habits, under, begun)
    search, habits = as_pauses_slow_the_wheels(search, habits, under, begun)
    search, habits = as_wheels_give(search, habits, under, begun)
    search, habits = with_a_slow_battery(search, habits, under, begun)
    return with_readings_that_lag(search, habits, under, begun)


def _grown(search: Search, habits: Habits, under: Under) -> tuple[Search, Habits]:
    """The first part of a search that has begun, also under the habits that replace those which were taken
    while little was known: the rest takes as long again under each, and seldom changes by which it leads."""
    if len(search.fit.point.active) < SEVERAL:
        return search, habits
    search = grown_on(search)
    search, habits = _under_another_filter(search, habits, under, grown_on)
    search, habits = as_wheels_give(search, habits, under, grown_on)
    search, habits = as_lags_of_the_robot(search, habits, under, grown_on)
    return as_pauses_slow_the_wheels_beside(search, habits, under)


def _braking(search: Search, habits: Habits, under: Under) -> tuple[Search, Habits]:
    """The search with motors that do at duty 0 what they were not taken to do, where that explains more."""
    other = replace(habits, brake=not habits.brake)
    return if_ahead(search, habits, under, other, under(other), [search.fit.point])


def _under_another_filter(
    search: Search, habits: Habits, under: Under, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search under another filter, where that explains more.

    Where nothing is named nobody asks: what a floor does to a robot whose loops answer it, many a filter with
    another time constant explains a little better. The firmware's may be the right one where a latency or a
    lag stands in for it, or for its pause a resistance or what has its scale, and need not be ahead before it
    has been searched under. A late gyro may be all that
    is commanded, under a filter that delays by as much less, and a latency of a sample the gyro alone under a
    median. That motors coast while they are sampled is the same drive with a resistance that is less by their
    share of the time, so it is taken where that is as likely. To encoders the firmware's filter is no more
    than that.
    """
    if habits.firmware is not None or sound(search):
        return search, habits
    roles = search.problem.features.roles
    read = reads_back_emf(roles)  # to encoders the firmware's chain alone is asked for its pause
    chains = (as_it_pauses(each, habits.chain, roles) for each in other_chains(habits.chain))
    chains = (each for each in chains if each != habits.chain)
    for other in under.new(search, habits, (replace(habits, chain=each) for each in chains)):
        pausing = pauses(other.chain)
        if pausing and not (read and usual_chain(habits.chain) == AT_ITS_END):
            continue
        firmware = usual_chain(other.chain) == Chain.firmware()
        like = LIKE_A_FILTER if habits.chain.coast_share else (*LIKE_A_FILTER, *SCALE)
        imitated = firmware and any(name.startswith(like) for name in search.fit.point.active)
        late, gyro = lags_instead(search, LATE_GYRO, (LATE,)), lags_instead(search, LATE, (LATE_GYRO, SLIP))
        starts = [search.fit.point, *late, *gyro]
        far, wanted = -FAR_BEHIND if imitated else DOUBT, -DOUBT if firmware else DOUBT
        if pausing or (firmware and not read):
            scaled = [name for name in search.fit.point.active if name.startswith(SCALE)]
            starts.append(without(search.fit.point, scaled))
            far = wanted = 0.0
        search, habits = if_ahead(search, habits, under, other, under(other), starts, far, wanted, by)
    return _median_and_chip(search, habits, under, by) if read else (search, habits)


def _median_and_chip(search: Search, habits: Habits, under: Under, by: Onward) -> tuple[Search, Habits]:
    """The search with a median and a gyro that smooths at once, where late commands were named without both
    and that is as likely: each by itself leaves the other half of what they delay unexplained."""
    if habits.chain.median or habits.low_pass or LATE not in search.fit.point.active:
        return search, habits
    point, (late,) = search.fit.point, search.problem.causes[LATE].coordinates
    cycle = cycle_of_samples(habits.chain)
    sooner = point.active[LATE] - cycle / late.value(1.0)
    less = [point.without_cause(LATE)]
    less += [point.with_cause(LATE, sooner)] if sooner[0] > 0.0 else []
    scaled = [name for name in point.active if name.startswith(SCALE)]
    starts = [each for one in less for each in (one, without(one, scaled))]
    own = habits.chain
    chains = (
        replace(with_driver_of(each, own), battery_time_constant=own.battery_time_constant, cycle=cycle)
        for each in (PAUSING, AT_ITS_END)
    )
    others = [replace(habits, chain=each, low_pass=True) for each in chains]
    for other in under.new(search, habits, others):
        found, now = if_ahead(search, habits, under, other, under(other), starts, 0.0, 0.0, by)
        if now == other:
            return found, now
    return search, habits


def _as_logged(search: Search, habits: Habits, under: Under) -> tuple[Search, Habits]:
    """The search under what else writes logs, where that explains more: something that follows the battery
    more slowly, a gyro that smooths, or one that writes what it has just done.

    Commands in the row after theirs seem early, as nothing in the catalogue is; that made a filter without a
    median, a latency of 3 ms and a gear that loses torque.
    """
    search, habits = with_a_slow_battery(search, habits, under)
    if habits.firmware is not None:
        return search, habits
    search, habits = with_whole_currents(search, habits, under)
    search, habits = as_a_deadband_ends(search, habits, under)
    search, habits = as_pauses_slow_the_wheels(search, habits, under)
    search, habits = with_readings_that_lag(search, habits, under)
    firmware = with_driver_of(Chain.firmware(), habits.chain)
    # A plain filter that stood in for it may have taken the battery's with it.
    seen = replace(firmware, battery_time_constant=habits.chain.battery_time_constant)
    chains = dict.fromkeys((habits.chain, seen, firmware))
    past = [replace(habits, chain=chain, past=True) for chain in chains]
    return first_ahead(search, habits, past, under)


def _with_the_slip_that_fits(search: Search, habits: Habits, under: Under) -> tuple[Search, Habits]:
    """The search, or that with slip which follows acceleration at once, where that explains more: to a lag
    it looks like a gyro that is late, or that smooths as well."""
    point, causes = search.fit.point, search.problem.causes
    late = [name for name in (LATE_GYRO, SLIP) if name in point.active]
    if not late or SLIP not in causes:
        return search, habits
    less = without(point, late)
    if not apart(SLIP, less.active):  # one wheel's slip was named
        return search, habits
    at_once = {key: 1.0 for key in search.problem.neutral if key[::2] == (SLIP, FORMS[SLIP])}
    slip = np.sum([lag_as(search, name, SLIP) for name in late], axis=0)
    chip = LOW_PASS / causes[SLIP].coordinates[0].value(1.0)
    for other, size in ((habits, slip), (replace(habits, low_pass=True), slip - chip)):
        if size <= 0.0 or (other is not habits and habits.low_pass):
            continue
        problem = under(other)
        problem = replace(problem, neutral=problem.neutral | at_once)
        ahead = leads(search, problem, [less.with_cause(SLIP, size)])
        if ahead < DOUBT:
            if late == [LATE_GYRO] and other is habits:
                or_another(search, LATE_GYRO, SLIP, -ahead)
            continue
        second = again(search, problem)
        if second is not None and SLIP in second.fit.point.active:
            search, habits = second, other
    return search, habits
