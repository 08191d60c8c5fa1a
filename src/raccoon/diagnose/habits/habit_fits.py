"""Fits that distinguish habits: of the wheels alone, with all base numbers free.

The robot's numbers do not matter yet, and no cause is known. Compared is how near to the wheels' readings
each habit can come.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import WHEELS
from raccoon.diagnose.fit.fitting import fit_point, fit_with_frozen_columns
from raccoon.diagnose.fit.noise_model import white_noise
from raccoon.diagnose.fit.problem import Point, Problem, transfer_columns, transfer_point
from raccoon.diagnose.fit.whitener import Whitener
from raccoon.diagnose.hypotheses.base_coordinates import MAX_BASE_STDS, WheelSliding, base_coordinates
from raccoon.diagnose.hypotheses.coordinates import (
    Coordinate,
    additive_coordinate,
    multiplicative_coordinate,
)
from raccoon.diagnose.rollout.encoder_window import WINDOW
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.rollout.sample_ages import SAMPLE_AGE

Array = NDArray[np.float64]

BEMF_FILTER_LAG, LATENCY = "bemf.filter_lag", "actuation.latency"
BASE_RANGE_STDS = 60.0
"""Range of base numbers in these fits, in standard deviations."""
COMPLIANCE, MAX_COMPLIANCE_STDS = ("friction.presliding", None, "compliance"), 1.7
"""The wheels' compliance has a usual size in these fits: with soft tyres, and no prior for any number, a ramp
of 8 per second came near to one of 6."""
CAUSE_STARTS = {LATENCY: (0.02, 0.5, 1.0, 1.7, 2.5, 3.5), "motor.current_limit": (0.1, 0.4, 0.6, 0.9)}
"""Coordinates of causes, of which the best is chosen for the start of a fit; the first has nearly no
effect."""
LONGER_WINDOW_STDS = 1.5
"""Standard deviations by which the encoders' window is longer in a further start of a fit."""
NEGLIGIBLE_ERROR = 1e-9
"""Error, in units of the reading, below which a channel does not count in the choice of a start."""
MASKING_COORDINATES = (
    multiplicative_coordinate("bemf.scale", "left", 0.05),
    multiplicative_coordinate("bemf.scale", "right", 0.05),
    additive_coordinate("actuation.deadband", None, "duty", 0.03, low=0.0),
)
"""Effects that no base number can imitate, and that would hide the effect of a filter. Without them deadbands
made the simulator's filter look like the firmware's in five of eight rehearsals, and a scale beside others
the firmware's like the simulator's."""
ROUGH_FIT_EXCESS, ROUGH_STEPS = 0.005, 8
"""Largest log misfit by which a fit with the columns of another may be above one with its own (of 14 none was
by more than 0.003), and the linearisations of such a fit."""


@dataclass(frozen=True, slots=True)
class HabitFit:
    """A fit under some habits: its point and its log misfit of the wheels. columns (coordinates, bins,
    channels): its last Jacobian."""

    log_misfit: float
    point: Point
    habits: Habits
    problem: Problem
    columns: Array

    @property
    def filter_as_specified(self) -> bool:
        """Whether the fitted time constant of the filter is within robot.toml's deviations, so that no cause
        is needed."""
        names = [each.settings[0][0] for each in self.problem.base]
        if BEMF_FILTER_LAG not in names:
            return True
        return abs(float(self.point.base[names.index(BEMF_FILTER_LAG)])) <= MAX_BASE_STDS

    def if_better_than(self, other: HabitFit, min_saved: float) -> HabitFit:
        """This fit if it saves so much log misfit, else the other."""
        return self if self.log_misfit < other.log_misfit - min_saved else other

    def carried_to(self, problem: Problem) -> Point:
        """The point of a fit in another problem, with the same coordinates or fewer, that uses the columns of
        this one: its log misfit is above that of a fit with its own columns by no more than
        `ROUGH_FIT_EXCESS`."""
        columns = transfer_columns(self.columns, self.problem, problem)
        assert columns is not None, "other habits have coordinates of their own"
        start = transfer_point(self.point, self.problem, problem)
        whitener = _whitener(problem, start)
        return fit_with_frozen_columns(problem, whitener, [start], whitener(columns), ROUGH_STEPS)[0].point


def with_all_base_free(problem: Problem, wheels: WheelSliding) -> Problem:
    """The problem with all base numbers free, including the filter's time constant: if that were kept near
    robot.toml, a robot with a shorter filter would seem to have another kind. It is one number for both
    wheels, and no loop's delay is free: with it the firmware's slots could not be distinguished.
    `MASKING_COORDINATES` are free as well."""
    base = [
        _with_usual_compliance(each).beside(problem.neutral)
        for each in base_coordinates(problem.robot, inside=BASE_RANGE_STDS, sliding=wheels)
        if each.settings[0][0] not in (BEMF_FILTER_LAG, LATENCY)
    ]
    kept = {WINDOW, *SAMPLE_AGE.values()}
    base.extend(each for each in problem.base if each.settings[0] in kept)
    std = problem.robot.model.bemf.filter_time_constant.std
    if std > 0.0:
        base.append(
            additive_coordinate(
                BEMF_FILTER_LAG, None, "time_constant", std, low=-BASE_RANGE_STDS, high=BASE_RANGE_STDS
            )
        )
    return replace(problem, base=(*base, *MASKING_COORDINATES))


def _with_usual_compliance(coordinate: Coordinate) -> Coordinate:
    """A base number that is at most `MAX_COMPLIANCE_STDS` if it is the wheels' compliance."""
    if coordinate.settings != (COMPLIANCE,):
        return coordinate
    return replace(coordinate, high=MAX_COMPLIANCE_STDS)


def choose_start(problem: Problem) -> Point:
    """The start of a fit that is nearest to the readings, among starts with a latency (which resembles a
    slower filter) and with a current limit. With encoders also with a longer window: a latency imitates half
    of it, and from there no fit finds the window."""
    starts = [problem.nominal(), *_with_longer_window(problem)]
    for name, sizes in CAUSE_STARTS.items():
        if name in problem.causes:
            starts = [
                _nearest_start(
                    problem, [each.with_cause(name, np.array([u])) for each in starts for u in sizes]
                )
            ]
    return _nearest_start(problem, starts)


def _nearest_start(problem: Problem, starts: list[Point]) -> Point:
    """The start that comes nearest to the readings."""
    if len(starts) == 1:
        return starts[0]
    errors = np.abs(problem.features.measured - problem.predict(starts)).mean(axis=1)
    least = np.maximum(errors.min(axis=0), NEGLIGIBLE_ERROR)
    return starts[int(np.argmin((errors / least).mean(axis=1)))]


def _with_longer_window(problem: Problem) -> list[Point]:
    """The nominal point with a longer window of the encoders; empty if there are none."""
    nominal = problem.nominal()
    places = [index for index, each in enumerate(problem.base) if each.settings == (WINDOW,)]
    return [
        replace(nominal, base=nominal.base + LONGER_WINDOW_STDS * np.eye(len(nominal.base))[each])
        for each in places
    ]


def fit_from(problem: Problem, start: Point, habits: Habits) -> HabitFit:
    """The fit from a start under these habits, whose problem is given."""
    whitener = _whitener(problem, start)
    fit = fit_point(problem, whitener, start, 5)
    columns = (
        fit.jacobian.reshape(-1, *problem.features.measured.shape)
        / whitener.noise.whitening_factors[0].diagonal()
    )
    return HabitFit(log_misfit(problem, fit.point), fit.point, habits, problem, columns)


def _whitener(problem: Problem, start: Point) -> Whitener:
    """White noise, with a scale in each channel equal to the median change of a start's residual from bin to
    bin."""
    residual = problem.features.measured - problem.predict([start])[0]
    scale = np.maximum(np.median(np.abs(np.diff(residual, axis=0)), axis=0), problem.features.floors)
    noise = white_noise(scale, np.zeros(len(residual), np.intp))
    return Whitener.plain(noise, residual)


def log_misfit(problem: Problem, point: Point) -> float:
    """Mean over the wheels of the logarithm of their mean absolute residual relative to the standard
    deviation of their readings."""
    features = problem.features
    residual = features.measured - problem.predict([point])[0]
    spread = np.maximum(np.std(features.measured, axis=0), features.floors)
    wheels = [index for index, role in enumerate(features.roles) if role in WHEELS]
    return float(np.log(np.abs(residual).mean(axis=0) / spread)[wheels].mean())
