"""What the controller does with its samples and at duty 0, and whether wheels give: found out, not diagnosed.

Whether the controller filters with a median is not in a recording, nor whether wheels give before they slide;
whether it brakes at duty 0 in few. Nothing of it is for a team to change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.stops import brakes
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.chains import FREE_RUNNING, USUAL_CHAINS, reads_back_emf, slowed_by_pauses
from raccoon.diagnose.habits.loose import ROUGHLY, Fitted, fitted, misfit, start_of
from raccoon.diagnose.habits.lost import restored
from raccoon.diagnose.habits.problems import loose_problem_of
from raccoon.diagnose.habits.ramps import CLEARLY as A_RAMP
from raccoon.diagnose.habits.ramps import behind_a_ramp
from raccoon.diagnose.hypotheses.base_coordinates import Wheels
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.recording import usual_step

USUAL = 0.06
"""How much log misfit another filter than the firmware's must save, unless it alone has robot.toml's time
constant: then nothing is asked of it."""
CLEARLY = 0.2
"""The same for motors that brake at duty 0, where both are possible."""
STIFF = 0.006
"""The same for wheels that do not give before they slide. Of 60 robots whose wheels did, rigid ones saved
0.004 at most, with two numbers less."""
SLOWED = 0.002
"""The same for wheels that a pause slows down before they are read, which is asked again beside causes. Of 15
drives with such pauses 11 saved that and more, of 11 without none saved anything."""
LONGEST_CYCLE = 0.1
"""s of the longest cycle that a `Chain` may have."""
QUICK_BATTERY = (0.005, 0.01)
SLOW_BATTERY = (0.05, 0.1, 0.2, 0.4)
"""s, of filters of the battery's reading that are tried, beside none and the firmware's. A recording that
falls between two of them is nearer to wrong habits: behind one of 5 ms a controller by its own clock was
taken for one that pauses at the end of a row, with a latency of 5 ms."""
LESS_OFF = 0.85
"""Part of the battery's error that is left with another filter of its readings, up to which it is taken at
once. With the firmware's own filter none left less than 0.9; RaccoonOS's further one of 0.1 s leaves 0.3 to
0.85."""


def controller_of(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None = None,
    found: Fitted | None = None,
) -> tuple[Log, Habits]:
    """The log with changes of commands whose rows it lost, and the controller's habits, see `nearest`.

    found: what is nearest, where that is known.
    """
    found = found or nearest(log, robot, causes, model, firmware)
    return restored(log, loose_problem_of(robot, causes, found.habits, model), found.point), found.habits


def _first(log: Log, firmware: Firmware | None) -> Habits:
    """What is tried first. Whoever reads no back-EMF need not let motors coast for it: with encoders a sound
    robot had a resistance that was 10 % low."""
    if firmware is not None:
        return Habits(firmware.chain, False, low_pass=firmware.smooths, firmware=firmware)
    return Habits(_usual_chains(log)[0], False)


def _usual_chains(log: Log) -> Sequence[Chain]:
    return USUAL_CHAINS if reads_back_emf(each.role for each in log.channels) else USUAL_CHAINS[::-1]


def nearest(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None = None,
) -> Fitted:
    """The controller's habits that come nearest to the wheels' readings, of which a drive has one at least.

    Judged by the wheels: what the gyro does says nothing of the filter of back-EMF, and the battery only
    what the wheels were driven with. firmware: of which nothing needs to be found out but, where the
    recording itself does not name it, what else filters the battery.
    """
    wheels = replace(log, channels=tuple(each for each in log.channels if each.role != "gyro"))
    first, reads = _first(log, firmware), reads_back_emf(each.role for each in log.channels)

    def loose(habits: Habits) -> Problem:
        return loose_problem_of(robot, causes, habits, model)(wheels)

    def fit_of(habits: Habits) -> Fitted:
        problem = loose(habits)
        return fitted(problem, start_of(problem), habits)

    def better(habits: Habits, found: Fitted, by: float) -> Fitted:
        problem = loose(habits)
        start = found.carried_to(problem)
        near = misfit(problem, start) < found.misfit - by + ROUGHLY
        return fitted(problem, start, habits).instead_of(found, by) if near else found

    def likelier(habits: Habits, found: Fitted) -> Fitted:
        if found.as_told:
            return better(habits, found, USUAL)
        other = better(habits, found, 0.0)
        return other if other.as_told else other.instead_of(found, USUAL)

    found = behind_a_ramp(fit_of(first), loose, causes)
    first = found.habits
    slow = None if first.knows_battery else _slow_battery(first, loose, found.point)
    if slow is not None:
        found = fit_of(with_battery(first, slow))
    if log.brake is None and brakes(log):
        found = fit_of(replace(found.habits, brake=True)).instead_of(found, CLEARLY)
        if found.habits.ramp is not None:  # without brakes, one made the stops of a robot that has them
            found = fit_of(replace(found.habits, ramp=None, brake=True)).instead_of(found, -A_RAMP)
    if firmware is None:
        by_row = cycle_by_row(log)
        if reads and not found.as_told and by_row == Chain().cycle:
            found = fit_of(_of_any_moment(found.habits)).instead_of(found, USUAL)
        plain = replace(found.habits, chain=_usual_chains(log)[1], any_moment=False)
        found = likelier(plain if slow is None else with_battery(plain, slow), found)
        if (once_a_row := with_cycle(found.habits, by_row)) != found.habits:
            found = better(once_a_row, found, USUAL)
    found = better(replace(found.habits, wheels=Wheels.RIGID), found, STIFF)
    slowed = slowed_by_pauses(found.habits.chain)
    if firmware is None and slowed is not None and reads:
        found = better(replace(found.habits, chain=slowed), found, SLOWED)
    return found


def _of_any_moment(habits: Habits) -> Habits:
    """With samples of any moment of a row. It is asked for before another filter, which with a latency looks
    like it."""
    time = habits.chain.battery_time_constant
    return replace(habits, chain=replace(FREE_RUNNING, battery_time_constant=time), any_moment=True)


def _slow_battery(habits: Habits, loose: Callable[[Habits], Problem], point: Point) -> float | None:
    """s of a filter of the battery's readings that they clearly show, None where they show none."""

    def off(problem: Problem) -> float:
        return battery_off(problem, [point, problem.nominal()])

    usual = loose(habits)
    if "battery" not in usual.features.roles:
        return None
    left = {each: off(loose(with_battery(habits, each))) for each in SLOW_BATTERY}
    best = min(left, key=left.__getitem__)
    return best if left[best] < LESS_OFF * off(usual) else None


def with_battery(habits: Habits, seconds: float) -> Habits:
    """With another filter of the battery's readings."""
    return replace(habits, chain=replace(habits.chain, battery_time_constant=seconds))


def cycle_by_row(log: Log) -> float:
    """s between two samples of a controller that takes one a row, where a row is so long that this is no
    usual one; the usual one's elsewhere. A program, or a simulation, may filter what it logs by itself."""
    row, usual = usual_step(log.time), Chain().cycle
    return row if 1.5 * usual < row <= LONGEST_CYCLE else usual


def with_cycle(habits: Habits, seconds: float) -> Habits:
    """With so much between two samples of the wheels."""
    return replace(habits, chain=replace(habits.chain, cycle=seconds))


def battery_off(problem: Problem, starts: Sequence[Point]) -> float:
    """By how much the battery's reading is off at best, its resistance and voltage as suit it."""
    index, sizes = problem.features.roles.index("battery"), []
    measured = problem.features.measured[:, index]
    for each in problem.predict(starts)[..., index]:
        columns = np.stack([np.ones_like(each), each], axis=1)
        factors, *_ = np.linalg.lstsq(columns, measured, rcond=None)
        sizes.append(float(np.abs(measured - columns @ factors).mean()))
    return min(sizes)
