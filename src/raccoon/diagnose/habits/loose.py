"""Fits that tell habits apart: of the wheels alone, every number of robot.toml free.

What a robot is does not matter yet, and no cause is known. What is compared is how near to the wheels'
readings each habit can come.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.fitting import fit_many, fit_point
from raccoon.diagnose.fit.noise_model import white_noise
from raccoon.diagnose.fit.problem import Point, Problem, carried, carried_columns
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.hypotheses.base_coordinates import INSIDE, Wheels, base_coordinates
from raccoon.diagnose.hypotheses.coordinates import added, multiplied
from raccoon.diagnose.rollout.encoder_window import WINDOW
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.rollout.sample_ages import AGE

Array = NDArray[np.float64]

FILTER, LATENCY = "bemf.filter_lag", "actuation.latency"
FAR = 60.0
"""Standard deviations that base numbers may move here."""
STARTS = {LATENCY: (0.02, 0.5, 1.0, 1.7, 2.5, 3.5), "motor.current_limit": (0.1, 0.4, 0.6, 0.9)}
"""Coordinates of causes from which one of a fit for the habits starts; the first changes next to nothing."""
LONGER = 1.5
"""Deviations by which encoders may count over more than a row, from where a fit starts as well."""
EXACT = 1e-9
"""Of each reading's unit: a channel that is simulated that well from any start decides nothing."""
HIDING = (
    multiplied("bemf.scale", "left", 0.05),
    multiplied("bemf.scale", "right", 0.05),
    added("actuation.deadband", None, "duty", 0.03, low=0.0),
)
"""What no base number can stand in for. Without them deadbands made the simulator's filter look like the
firmware's in five of eight rehearsals, and a scale beside others the firmware's like the simulator's."""
ROUGHLY, ROUGH_STEPS = 0.005, 8
"""Log misfit by which a fit may come nearer once it has columns of its own, and the steps of one that has
not: of 14 none came nearer by more than 0.003."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """Where a fit under some habits arrives, and with which log misfit. columns (coordinates, bins,
    channels): those of its last look."""

    misfit: float
    point: Point
    habits: Habits
    problem: Problem
    columns: Array

    @property
    def as_told(self) -> bool:
        """Whether robot.toml's time constant of the filter is inside its deviations here: no cause is
        needed."""
        names = [each.settings[0][0] for each in self.problem.base]
        return FILTER not in names or abs(float(self.point.base[names.index(FILTER)])) <= INSIDE

    def instead_of(self, other: Fitted, by: float) -> Fitted:
        """This one where it saves that much, else the other."""
        return self if self.misfit < other.misfit - by else other

    def carried_to(self, problem: Problem) -> Point:
        """Where a fit in another problem, of these coordinates or fewer, arrives with the columns of this: as
        near to the readings, by `ROUGHLY`, as with columns of its own."""
        columns = carried_columns(self.columns, self.problem, problem)
        assert columns is not None, "other habits have coordinates of their own"
        start = carried(self.point, self.problem, problem)
        whitener = _whitener(problem, start)
        return fit_many(problem, whitener, [start], whitener(columns), ROUGH_STEPS)[0].point


def loosened(problem: Problem, wheels: Wheels) -> Problem:
    """With all base numbers free, the filter's time constant among them: kept near robot.toml, a robot with a
    shorter filter would seem to have another one. It is one for both wheels, and no loop's delay is free: the
    firmware's slots could be anything then. And with what they cannot stand in for, whose error would hide
    what a filter does."""
    base = [
        each.beside(problem.neutral)
        for each in base_coordinates(problem.robot, inside=FAR, wheels=wheels)
        if each.settings[0][0] not in (FILTER, LATENCY)
    ]
    kept = {WINDOW, *AGE.values()}
    base.extend(each for each in problem.base if each.settings[0] in kept)
    std = problem.robot.model.bemf.filter_time_constant.std
    if std > 0.0:
        base.append(added(FILTER, None, "time_constant", std, low=-FAR, high=FAR))
    return replace(problem, base=(*base, *HIDING))


def start_of(problem: Problem) -> Point:
    """Where to start a fit: with a latency, which resembles a slower filter, and a limit of the current. With
    encoders also with a longer window: a latency stands for half of it, and from there no fit finds back."""
    starts = [problem.nominal(), *_with_longer_window(problem)]
    for name, sizes in STARTS.items():
        if name in problem.causes:
            starts = [
                _nearest(problem, [each.with_cause(name, np.array([u])) for each in starts for u in sizes])
            ]
    return _nearest(problem, starts)


def _nearest(problem: Problem, starts: list[Point]) -> Point:
    """The start that comes nearest to the readings."""
    if len(starts) == 1:
        return starts[0]
    errors = np.abs(problem.features.measured - problem.predict(starts)).mean(axis=1)
    least = np.maximum(errors.min(axis=0), EXACT)
    return starts[int(np.argmin((errors / least).mean(axis=1)))]


def _with_longer_window(problem: Problem) -> list[Point]:
    nominal = problem.nominal()
    places = [index for index, each in enumerate(problem.base) if each.settings == (WINDOW,)]
    return [replace(nominal, base=nominal.base + LONGER * np.eye(len(nominal.base))[each]) for each in places]


def fitted(problem: Problem, start: Point, habits: Habits) -> Fitted:
    """Where a fit from there arrives."""
    whitener = _whitener(problem, start)
    fit = fit_point(problem, whitener, start, 5)
    columns = fit.jacobian.reshape(-1, *problem.features.measured.shape) / whitener.noise.unmix[0].diagonal()
    return Fitted(misfit(problem, fit.point), fit.point, habits, problem, columns)


def _whitener(problem: Problem, start: Point) -> Whitener:
    """Noise without memory, as large in each channel as changes from bin to bin of what a start leaves."""
    residual = problem.features.measured - problem.predict([start])[0]
    scale = np.maximum(np.median(np.abs(np.diff(residual, axis=0)), axis=0), problem.features.floors)
    noise = white_noise(scale, np.zeros(len(residual), np.intp))
    return Whitener.plain(noise, residual)


def misfit(problem: Problem, point: Point) -> float:
    """Log misfit of the wheels at a point."""
    features = problem.features
    left = features.measured - problem.predict([point])[0]
    size = np.maximum(np.std(features.measured, axis=0), features.floors)
    wheels = [index for index, role in enumerate(features.roles) if role in WHEELS]
    return float(np.log(np.abs(left).mean(axis=0) / size)[wheels].mean())
