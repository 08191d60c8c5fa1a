"""Lags that were named, and what else may make them: a gyro's chip that smooths, a controller whose cycle has
a clock of its own, another lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.doing import tell
from raccoon.diagnose.fit.fitting import fit_point
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.chains import FREE_RUNNING, USUAL_CHAINS, as_it_pauses, with_driver_of
from raccoon.diagnose.habits.controller import QUICK_BATTERY, SLOW_BATTERY, with_battery
from raccoon.diagnose.habits.others import DOUBT, LATE, Onward, Under, best_of, by_the_battery, without
from raccoon.diagnose.hypotheses.base_coordinates import LOW_PASS
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.alternative_sets import explains_more
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.refits import SMOOTHS, lag_as
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import gone_on, whole
from raccoon.diagnose.select.set_scoring import apart
from raccoon.diagnose.select.state import Rival, Search, lead, look_around
from raccoon.diagnose.unknown.probes import make_probe_function
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import SIDES

Array = NDArray[np.float64]

LATE_GYRO, SLIP = "imu.latency", "drive.wheel_slip"
OF_THE_GYRO = (LATE_GYRO, SLIP)
"""What a gyro alone sees late."""
SMOOTH = 3.0
"""Log evidence, gates counted, by which a gyro that smooths must lead. Wheels that slip by its time are the
same to it, and lack their gate."""
FEW = 2
"""Other causes beside which that is so. The stock firmware's chip smooths, so of a robot with one or two
things wrong the lag is usually its; of one with many a small slip may well be one more."""
CLEARLY = 15.0
"""Log evidence by which it must lead there in the end. It has two numbers and a slip one: beside three causes
and more it led by 1 to 4, once by 11, of wheels that slip, and by 3 to 24 where the chip does smooth. It was
14 ahead of a fit of slip that had not arrived, which leads by 1."""


def with_readings_that_lag(
    search: Search, habits: Habits, under: Under, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search with a gyro whose chip smooths, or a controller by its own clock as well, where something
    lags as such readings do and that explains it better.

    The clock comes first: it is how a Wombat works, and need not be ahead before it has been searched under,
    nor by more than the gates of the lags that it takes up. So it is with a gyro that smooths where lags are
    all that was found, and beside a few causes once a search was whole. A robot of which more is wrong may
    slip as well, and a slip and a late gyro together look like a gyro's filter: there that must explain more
    by itself, or else it is a rival of the lag. A search that has only begun does not know how much is wrong.
    """
    point, late = search.fit.point, _late(search)
    if not late or under.left or "gyro" not in search.problem.features.roles:
        return search, habits
    smooth = replace(habits, low_pass=True)
    free = _by_its_own_clock(search, smooth, under)
    starts = starts_with_a_chip(search, _of_the_gyro(search), late)
    others = len(point.active.keys() - late)
    alone = others == 0 or (others <= FEW and by is whole and not search.unknown)
    wanted = {smooth: SMOOTH if alone else DOUBT, free: -DOUBT}
    found = []
    for other in under.new(search, habits, (each for each in wanted if each != habits)):
        problem = under(other)
        fit = best_of(search, problem, starts)
        by_gates = alone or other is free
        ahead = net_lead(search, fit, search.fit) if by_gates else lead(problem, fit, search.fit)
        if ahead >= wanted[other]:
            found.append((other, problem, fit.point))
        elif by is whole:
            under.were_vain(search, habits, [other])
    for other, problem, there in reversed(found):
        tell("going on as another gyro or clock would have it")
        second = by(look_around(problem, make_probe_function(problem), there, search.whitener))
        if explains_more(second, search) > -SMOOTH:
            return second, other
    return search, habits


def as_lags_of_the_robot(
    search: Search, habits: Habits, under: Under, by: Onward = gone_on
) -> tuple[Search, Habits]:
    """The search without a gyro that smooths and a clock of the controller's own, where more turned out to be
    wrong than when these were taken, lags of the catalogue explain about as much, and one of the gyro has the
    evidence that it needs.

    Instead of a clock they must explain more: on robots with one they lack up to 8, and lead by 30 to 145
    where there is none; by 7 where samples that may be of any moment are the firmware's. What was left so is
    not asked for again.
    """
    active, clock = search.fit.point.active.keys(), habits.chain.free_running
    others = active - (_late(search) if clock else _of_the_gyro(search))  # a chip makes no command late
    if not (habits.low_pass or clock) or habits.wombat or len(others) <= FEW:
        return search, habits
    other = replace(habits, low_pass=False)
    if clock:
        usual = replace(Chain.firmware(), coast_share=habits.chain.coast_share)
        other = with_battery(
            replace(other, chain=with_driver_of(usual, habits.chain)), habits.chain.battery_time_constant
        )
        other = replace(other, any_moment=False)
    wanted = CLEARLY if not clock else -SMOOTH if habits.any_moment else -DOUBT
    problem = under(other)  # asked for in vain or not: without lags, the usual filter is far behind a clock
    fit = best_of(search, problem, _with_lags_instead(search, problem))
    settled = fit_point(search.problem, search.whitener, search.fit)  # as the other is
    if lead(problem, settled, fit) < wanted:
        tell("going on with lags of the robot instead of its gyro's filter or its controller's clock")
        found = by(seen_from(search, problem, fit.point))
        if _of_the_gyro(found) or clock:
            under.left.add(habits)
            return found, other
    return search, habits


def _with_lags_instead(search: Search, problem: Problem) -> list[Point]:
    """Where a search ended, with all by which its gyro is late as a slip, a late gyro, or half of each; in a
    problem that leaves less of it open. So it is with the commands. One wheel that slips beside a gyro that
    smooths is usually half of both."""
    point, causes = search.fit.point, problem.causes
    settings = search.problem.settings(point)
    seconds = settings[SMOOTHS, None, "time_constant"] + settings[LATE_GYRO, None, "seconds"]
    seconds += 0.5 * sum(settings[SLIP, side, "time"] for side in SIDES)
    less = without(point, _of_the_gyro(search))

    def as_cause(name: str, late: float) -> dict[str, Array]:
        """A lag of so many seconds, where the catalogue has it."""
        return {name: np.array([late / causes[name].coordinates[0].value(1.0)])} if name in causes else {}

    gyro = [as_cause(each, seconds) for each in OF_THE_GYRO]
    gyro.append({name: 0.5 * u for each in gyro for name, u in each.items()})
    waits = as_cause(LATE, settings[LATE, None, "seconds"])
    return [replace(less, active={**less.active, **now, **lag}) for lag in gyro for now in ({}, waits)]


def starts_with_a_chip(search: Search, seen: Sequence[str], late: Sequence[str]) -> list[Point]:
    """Where a search ended, with lags of the gyro (seen) and others (late) less by what a chip takes up, or
    without them. Each also alone: a chip that is a little slower than usual takes up all of one beside
    another, and what is left of it must not cost a gate."""
    point = search.fit.point
    return [
        point,
        *(_sooner_by(search, each, LOW_PASS) for each in seen),
        *(point.without_cause(each) for each in seen),
        *(without(point, names) for names in (seen, late)),
    ]


def _by_its_own_clock(search: Search, habits: Habits, under: Under) -> Habits:
    """These habits of a controller whose cycle has a clock of its own, with the filter of the battery's
    readings that suits them; one that was seen is kept. Whoever reads no back-EMF need not pause for it."""
    time = habits.chain.battery_time_constant
    free = with_driver_of(FREE_RUNNING, habits.chain)
    chain = as_it_pauses(free, habits.chain, search.problem.features.roles)
    times = {time}
    if time not in SLOW_BATTERY:
        times = {*QUICK_BATTERY, *(each.battery_time_constant for each in USUAL_CHAINS)}
    others = [with_battery(replace(habits, chain=chain), each) for each in sorted(times)]
    if len(others) == 1 or "battery" not in search.problem.features.roles:
        return others[0]
    return by_the_battery(search, {each: under(each) for each in others}, [search.fit.point])


def left_to_the_firmware(search: Search, habits: Habits) -> Search:
    """The search without a lag that is no more than a known firmware may have anyway.

    Rows make steps of what a latency does, and a fit of what is open stops on one: a sound robot of which 3.4
    ms were found open had 0.8 ms more with 42 of log evidence, and none where all 4.2 are tried as open.
    """
    for name in _late(search) if habits.wombat else ():
        start = _open_instead(search, name)
        if start is None:
            continue
        fit = fit_point(search.problem, search.whitener, start)
        if lead(search.problem, search.fit, fit) < gate(name):
            search.failed[name] = "no later than the firmware itself may be"
            found = seen_from(search, search.problem, fit.point)
            found.failed.update(search.failed)
            return gone_on(found)
    return search


def _open_instead(search: Search, name: str) -> Point | None:
    """Where a search ended, with a lag added to what is open of the same number; None where nothing is."""
    point, (coordinate,) = search.fit.point, search.problem.causes[name].coordinates
    for index, each in enumerate(search.problem.base):
        if each.settings == coordinate.settings:
            base = point.base.copy()
            base[index] += coordinate.value(float(point.active[name][0])) / each.value(1.0)
            if each.low <= base[index] <= each.high:
                return replace(point.without_cause(name), base=base)
    return None


def or_a_smooth_gyro(search: Search, habits: Habits, under: Under) -> tuple[Search, Habits]:
    """The search, with a note beside a lag of the gyro that a chip which smooths may be all of it; or the
    search with such a chip, where it is clearly ahead of the lag that was named."""
    late = [] if habits.low_pass else [each for each in _late(search) if each in OF_THE_GYRO]
    few = len(search.fit.point.active.keys() - _of_the_gyro(search)) <= FEW
    if not late or "gyro" not in search.problem.features.roles:
        return search, habits
    smooth = replace(habits, low_pass=True)
    problem = under(smooth)
    problem = replace(problem, neutral={**problem.neutral, **search.problem.neutral})
    settled = fit_point(search.problem, search.whitener, search.fit)
    for name in late:
        fit = best_of(search, problem, [search.fit.point.without_cause(name)])
        lacks = lead(problem, settled, fit)
        if lacks < -(DOUBT if few else CLEARLY) and habits.firmware is None:
            tell("going on with a gyro that smooths")
            found = gone_on(seen_from(search, problem, fit.point))
            if explains_more(found, search) > -SMOOTH:
                return found, smooth
        or_another(search, name, SMOOTHS, lacks)
    return search, habits


def or_another(search: Search, name: str, other: str, lacks: float) -> None:
    """Note that another may be in a cause's place, in a form that lacks as much log evidence."""
    known = search.rivals.get(name, [])
    found = [Rival(other, lacks), *(each for each in known if each.name == other)]
    best = min(found, key=lambda each: each.lead)
    search.rivals[name] = sorted(
        [*(each for each in known if each.name != other), best], key=lambda each: each.lead
    )


def seen_from(search: Search, problem: Problem, point: Point) -> Search:
    """Where a search goes on from a point, in this problem; what it called unknown stays so."""
    return look_around(problem, make_probe_function(problem), point, search.whitener, search.unknown)


def _late(search: Search) -> list[str]:
    """What was named that lags."""
    return [name for name in search.fit.point.active if name.startswith((LATE, *OF_THE_GYRO))]


def _of_the_gyro(search: Search) -> list[str]:
    """What was named that a gyro alone sees late."""
    return [name for name in search.fit.point.active if name.startswith(OF_THE_GYRO)]


def lags_instead(search: Search, name: str, others: Sequence[str]) -> list[Point]:
    """Where a search ended, each time with another of these lags instead of a named one."""
    point = search.fit.point
    if name not in point.active:
        return []
    less = point.without_cause(name)
    asked = [each for each in others if each in search.problem.causes and apart(each, less.active)]
    return [less.with_cause(each, lag_as(search, name, each)) for each in asked]


def _sooner_by(search: Search, name: str, seconds: float) -> Point:
    """Where a search ended, with a lag less by that much, or without it where that is all of it."""
    point, (coordinate,) = search.fit.point, search.problem.causes[name].coordinates
    left = point.active[name] - seconds / coordinate.value(1.0)
    return point.with_cause(name, left) if left[0] > 0.0 else point.without_cause(name)
