"""A ramp between commands and motors, of which no column tells: found out as a habit of the controller.

A driver that starts softly, and a program or firmware that limits how fast its commands change below where
they are recorded, were a limit of the current with a deadband, stiction, a latency and more beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.ramps import Ramp
from raccoon.diagnose.fit.problem import Point, Problem, carried
from raccoon.diagnose.habits.loose import Fitted, fitted, misfit, start_of
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.rollout.plant_rollout import Habits

Array = NDArray[np.float64]

RATES = (30.0, 20.0, 12.0, 8.0, 5.0, 3.0)
"""Duty a second that are tried, the gentlest first: where even that does harm, as of most drives, no other is
tried. One of 40 is over in 25 ms, as a reading's filter is."""
ROUGHLY, FINELY = (0.4, 0.2), (0.1, 0.05, 0.025, 0.012, 0.006, 0.003)
"""How far beside the likeliest, as a part of it, it is looked for before it is judged, and once it is taken;
with a fit each, since a latency goes with it."""
CLEARLY = 0.4
"""Log misfit that a ramp must save, all base numbers free. It was 0.77 to 3.05 on 24 drives behind one of 5
to 20 a second, alone and beside a cause, 0.2 behind one of 40, and 0.05 at most without one, with limits of
the current, latencies and each other cause."""


def behind_a_ramp(found: Fitted, loose: Callable[[Habits], Problem], causes: Sequence[Cause]) -> Fitted:
    """The habits with a ramp between commands and motors where the wheels are clearly nearer to it, else as
    they are. loose: the problem under habits, see `loosened`. causes: that are asked for; where a team has an
    idea of its own of what reaches the motors, a ramp would take the better part of it."""
    if any(each.own is not None and each.own.commands is not None for each in causes):
        return found
    starts = (found.problem.nominal(), found.point)

    def missed(ramp: Ramp | None) -> Array:
        problem = loose(replace(found.habits, ramp=ramp))
        return np.array([misfit(problem, carried(each, found.problem, problem)) for each in starts])

    def near(ramp: Ramp, point: Point | None = None) -> Fitted:
        habits = replace(found.habits, ramp=ramp)
        problem = loose(habits)
        return fitted(problem, start_of(problem) if point is None else point, habits)

    def beside(best: Fitted, part: float) -> Fitted:
        ramp = best.habits.ramp
        assert ramp is not None
        rates = (ramp.rate * (1.0 - part), ramp.rate * (1.0 + part))
        tried = [near(replace(ramp, rate=each), best.point) for each in rates]
        return min(best, *tried, key=lambda each: each.misfit)

    plain = missed(None)
    left: dict[Ramp, Array] = {}
    for rate in RATES:
        left |= {each: missed(each) for each in (Ramp(rate), Ramp(rate, soft=True))}
        if not any((each < plain).any() for each in left.values()):
            return found
    ramp = min(left, key=lambda each: left[each].min())
    best = near(ramp)
    for part in ROUGHLY:
        best = beside(best, part)
    if best.misfit > found.misfit - CLEARLY:
        return found
    for part in FINELY:
        best = beside(best, part)
    return best
