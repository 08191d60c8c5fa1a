"""Detection of a ramp between commands and motors, which has no column: a habit of the controller.

A driver that starts softly, and a program or firmware that limits the rate of its commands after they are
recorded, would be reported as a current limit with a deadband, stiction, a latency and more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.ramp import Ramp
from raccoon.diagnose.fit.problem import Point, Problem, transfer_point
from raccoon.diagnose.habits.habit_fits import HabitFit, choose_start, fit_from, log_misfit
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.rollout.plant_rollout import Habits

Array = NDArray[np.float64]

RAMP_RATES = (30.0, 20.0, 12.0, 8.0, 5.0, 3.0)
"""Rates (duty per second) that are tried, from the largest: if even that one fits worse, as on most drives,
no other is tried. A ramp of 40 takes 25 ms, as long as a reading's filter."""
COARSE_STEPS, FINE_STEPS = (0.4, 0.2), (0.1, 0.05, 0.025, 0.012, 0.006, 0.003)
"""Relative steps to either side of the best rate by which it is refined before the decision, and after it;
with a fit each, since a latency changes with the rate."""
MIN_MISFIT_SAVED_BY_RAMP = 0.4
"""Log misfit that a ramp must save, all base numbers free. It was 0.77 to 3.05 on 24 drives behind a ramp of
5 to 20 per second, alone and beside a cause, 0.2 behind one of 40, and at most 0.05 without one, with current
limits, latencies and each other cause."""


def with_ramp_if_clear(
    fit: HabitFit, free_problem: Callable[[Habits], Problem], causes: Sequence[Cause]
) -> HabitFit:
    """The fit with a ramp between commands and motors if the wheels are clearly nearer to it, else the
    unchanged fit.

    free_problem: the problem under habits, see `with_all_base_free`. causes: those that are searched for; if
    one is a team's own effect on the commands, no ramp is tried, since it would absorb most of that effect.
    """
    if any(each.own is not None and each.own.commands is not None for each in causes):
        return fit
    starts = (fit.problem.nominal(), fit.point)

    def misfits(ramp: Ramp | None) -> Array:
        problem = free_problem(replace(fit.habits, ramp=ramp))
        return np.array([log_misfit(problem, transfer_point(each, fit.problem, problem)) for each in starts])

    def fit_ramp(ramp: Ramp, start: Point | None = None) -> HabitFit:
        habits = replace(fit.habits, ramp=ramp)
        problem = free_problem(habits)
        return fit_from(problem, choose_start(problem) if start is None else start, habits)

    def refine(best: HabitFit, part: float) -> HabitFit:
        ramp = best.habits.ramp
        assert ramp is not None
        rates = (ramp.rate * (1.0 - part), ramp.rate * (1.0 + part))
        tried = [fit_ramp(replace(ramp, rate=each), best.point) for each in rates]
        return min(best, *tried, key=lambda each: each.log_misfit)

    without_ramp = misfits(None)
    with_ramp: dict[Ramp, Array] = {}
    for rate in RAMP_RATES:
        with_ramp |= {each: misfits(each) for each in (Ramp(rate), Ramp(rate, soft=True))}
        if not any((each < without_ramp).any() for each in with_ramp.values()):
            return fit
    best = fit_ramp(min(with_ramp, key=lambda each: with_ramp[each].min()))
    for part in COARSE_STEPS:
        best = refine(best, part)
    if best.log_misfit > fit.log_misfit - MIN_MISFIT_SAVED_BY_RAMP:
        return fit
    for part in FINE_STEPS:
        best = refine(best, part)
    return best
