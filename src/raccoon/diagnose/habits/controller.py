"""Estimation of a drive's habits before any cause is known: the controller's samples, duty 0, compliance of
wheels.

A recording does not state whether the controller filters with a median, nor whether wheels are compliant
before they slide; few state whether it brakes at duty 0. A team cannot change any of these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.stops import motors_brake
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.habits.chains import (
    FREE_RUNNING,
    USUAL_CHAINS,
    has_back_emf,
    with_pause_slowdown_toggled,
)
from raccoon.diagnose.habits.habit_fits import (
    ROUGH_FIT_EXCESS,
    HabitFit,
    choose_start,
    fit_from,
    log_misfit,
)
from raccoon.diagnose.habits.lost_commands import restore_lost_changes
from raccoon.diagnose.habits.problems import free_problem_of
from raccoon.diagnose.habits.ramp_detection import MIN_MISFIT_SAVED_BY_RAMP, with_ramp_if_clear
from raccoon.diagnose.hypotheses.base_coordinates import WheelSliding
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.recording import median_step

MIN_MISFIT_SAVED_BY_FILTER = 0.06
"""Log misfit that another filter than the firmware's must save, unless it is the only one with robot.toml's
time constant: then it need not save any."""
MIN_MISFIT_SAVED_BY_BRAKES = 0.2
"""The same for motors that brake at duty 0, if both are possible."""
MIN_MISFIT_SAVED_BY_RIGID_WHEELS = 0.006
"""The same for wheels without compliance before they slide. On 60 robots with compliant wheels, rigid ones
saved 0.004 at most, with two numbers fewer."""
MIN_MISFIT_SAVED_BY_PAUSE = 0.002
"""The same for wheels that a pause slows down before they are sampled, which is tested again beside causes.
On 15 drives with such pauses 11 saved that and more, on 11 without none saved anything."""
MAX_CYCLE_S = 0.1
"""Upper bound in s of the cycle of a `Chain`."""
FAST_BATTERY_FILTERS_S = (0.005, 0.01)
SLOW_BATTERY_FILTERS_S = (0.05, 0.1, 0.2, 0.4)
"""Time constants in s of filters of the battery's reading that are tested, besides none and the firmware's. A
recording between two of them favours wrong habits: behind a filter of 5 ms a controller with its own clock
was taken for one that pauses at the end of a row, with a latency of 5 ms."""
MAX_BATTERY_ERROR_RATIO = 0.85
"""Ratio of the battery's error with another filter of its readings to that with the firmware's, up to which
the filter is adopted at once. With the firmware's own filter the ratio was never below 0.9; with RaccoonOS's
further one of 0.1 s it is 0.3 to 0.85."""


def find_habits(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None = None,
    fit: HabitFit | None = None,
) -> tuple[Log, Habits]:
    """The log with changes of commands whose rows it lost, and the controller's habits; see `fit_habits`.

    fit: the fit of the habits, if it exists.
    """
    fit = fit or fit_habits(log, robot, causes, model, firmware)
    free_problem = free_problem_of(robot, causes, fit.habits, model)
    return restore_lost_changes(log, free_problem, fit.point), fit.habits


def _initial_habits(log: Log, firmware: Firmware | None) -> Habits:
    """The habits that are tried first. A controller that reads no back-EMF need not let motors coast: with
    encoders a fault-free robot would have a resistance that is 10 % low."""
    if firmware is not None:
        return Habits(firmware.chain, False, low_pass=firmware.has_gyro_low_pass, firmware=firmware)
    return Habits(_usual_chains(log)[0], False)


def _usual_chains(log: Log) -> Sequence[Chain]:
    """The usual chains in the order in which they are tried."""
    return USUAL_CHAINS if has_back_emf(each.role for each in log.channels) else USUAL_CHAINS[::-1]


def fit_habits(
    log: Log,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None = None,
) -> HabitFit:
    """The fit under the habits that come nearest to the wheels' readings; a drive has at least one wheel's
    readings.

    Only the wheels' readings count (and the battery's, for the voltage that drove the wheels): the gyro shows
    nothing of the filter of back-EMF. firmware: the known firmware, of which only the battery's further
    filter is estimated, and only if the recording itself does not name the firmware.
    """
    wheels = replace(log, channels=tuple(each for each in log.channels if each.role != "gyro"))
    first, back_emf = _initial_habits(log, firmware), has_back_emf(each.role for each in log.channels)

    def free_problem(habits: Habits) -> Problem:
        return free_problem_of(robot, causes, habits, model)(wheels)

    def fit_under(habits: Habits) -> HabitFit:
        problem = free_problem(habits)
        return fit_from(problem, choose_start(problem), habits)

    def better_of(habits: Habits, best: HabitFit, min_saved: float) -> HabitFit:
        """The fit under habits if it saves so much log misfit, which a rough fit must promise first; else the
        best."""
        problem = free_problem(habits)
        start = best.carried_to(problem)
        near = log_misfit(problem, start) < best.log_misfit - min_saved + ROUGH_FIT_EXCESS
        return fit_from(problem, start, habits).if_better_than(best, min_saved) if near else best

    def likelier_filter(habits: Habits, best: HabitFit) -> HabitFit:
        if best.filter_as_specified:
            return better_of(habits, best, MIN_MISFIT_SAVED_BY_FILTER)
        other = better_of(habits, best, 0.0)
        if other.filter_as_specified:
            return other
        return other.if_better_than(best, MIN_MISFIT_SAVED_BY_FILTER)

    best = with_ramp_if_clear(fit_under(first), free_problem, causes)
    first = best.habits
    slow = None if first.knows_battery else _detect_battery_filter(first, free_problem, best.point)
    if slow is not None:
        best = fit_under(with_battery_filter(first, slow))
    if log.brake is None and motors_brake(log):
        best = fit_under(replace(best.habits, brake=True)).if_better_than(best, MIN_MISFIT_SAVED_BY_BRAKES)
        if best.habits.ramp is not None:  # without brakes, a ramp imitated the stops of a braking robot
            no_ramp = fit_under(replace(best.habits, ramp=None, brake=True))
            best = no_ramp.if_better_than(best, -MIN_MISFIT_SAVED_BY_RAMP)
    if firmware is None:
        row_cycle = sample_cycle_from_rows(log)
        if back_emf and not best.filter_as_specified and row_cycle == Chain().cycle:
            any_moment = fit_under(_with_free_sample_moments(best.habits))
            best = any_moment.if_better_than(best, MIN_MISFIT_SAVED_BY_FILTER)
        plain = replace(best.habits, chain=_usual_chains(log)[1], fits_sample_ages=False)
        best = likelier_filter(plain if slow is None else with_battery_filter(plain, slow), best)
        if (once_a_row := with_sample_cycle(best.habits, row_cycle)) != best.habits:
            best = better_of(once_a_row, best, MIN_MISFIT_SAVED_BY_FILTER)
    best = better_of(replace(best.habits, sliding=WheelSliding.RIGID), best, MIN_MISFIT_SAVED_BY_RIGID_WHEELS)
    slowed = with_pause_slowdown_toggled(best.habits.chain)
    if firmware is None and slowed is not None and back_emf:
        best = better_of(replace(best.habits, chain=slowed), best, MIN_MISFIT_SAVED_BY_PAUSE)
    return best


def _with_free_sample_moments(habits: Habits) -> Habits:
    """Habits with samples at any moment of a row. They are tried before another filter, which together with a
    latency imitates them."""
    time = habits.chain.battery_time_constant
    return replace(habits, chain=replace(FREE_RUNNING, battery_time_constant=time), fits_sample_ages=True)


def _detect_battery_filter(
    habits: Habits, free_problem: Callable[[Habits], Problem], point: Point
) -> float | None:
    """Time constant in s of a slow filter of the battery's readings if they clearly show one; else None."""

    def error(problem: Problem) -> float:
        return battery_error(problem, [point, problem.nominal()])

    usual = free_problem(habits)
    if "battery" not in usual.features.roles:
        return None
    errors = {each: error(free_problem(with_battery_filter(habits, each))) for each in SLOW_BATTERY_FILTERS_S}
    best = min(errors, key=errors.__getitem__)
    return best if errors[best] < MAX_BATTERY_ERROR_RATIO * error(usual) else None


def with_battery_filter(habits: Habits, seconds: float) -> Habits:
    """The habits with another filter of the battery's readings."""
    return replace(habits, chain=replace(habits.chain, battery_time_constant=seconds))


def sample_cycle_from_rows(log: Log) -> float:
    """Time in s between two samples of a controller that takes one per row, if a row is longer than its usual
    cycle; else that cycle. A program, or a simulation, may itself filter what it logs."""
    row, usual = median_step(log.time), Chain().cycle
    return row if 1.5 * usual < row <= MAX_CYCLE_S else usual


def with_sample_cycle(habits: Habits, seconds: float) -> Habits:
    """The habits with so many s between two samples of the wheels."""
    return replace(habits, chain=replace(habits.chain, cycle=seconds))


def battery_error(problem: Problem, starts: Sequence[Point]) -> float:
    """Smallest mean error (V) of the battery's reading over these starts, each with its best scale and
    offset, which stand for another resistance and voltage."""
    index, errors = problem.features.roles.index("battery"), []
    measured = problem.features.measured[:, index]
    for each in problem.predict(starts)[..., index]:
        columns = np.stack([np.ones_like(each), each], axis=1)
        factors, *_ = np.linalg.lstsq(columns, measured, rcond=None)
        errors.append(float(np.abs(measured - columns @ factors).mean()))
    return min(errors)
