"""Fits that tell habits apart: of the wheels alone, every number of robot.toml free.

What a robot is does not matter yet, and no cause is known. What is compared is how near to the wheels'
readings each habit can come.
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
from raccoon.diagnose.hypotheses.coordinates import additive_coordinate, multiplicative_coordinate
from raccoon.diagnose.rollout.encoder_window import WINDOW
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.rollout.sample_ages import SAMPLE_AGE

Array = NDArray[np.float64]

BEMF_FILTER_LAG, LATENCY = "bemf.filter_lag", "actuation.latency"
BASE_RANGE_STDS = 60.0
"""Standard deviations that base numbers may move here."""
CAUSE_STARTS = {LATENCY: (0.02, 0.5, 1.0, 1.7, 2.5, 3.5), "motor.current_limit": (0.1, 0.4, 0.6, 0.9)}
"""Coordinates of causes of which one is chosen as the start of a fit; the first changes next to nothing."""
LONGER_WINDOW_STDS = 1.5
"""Standard deviations by which encoders count over more than a row in a further start of a fit."""
NEGLIGIBLE_ERROR = 1e-9
"""Of each reading's unit: a channel that is simulated that well from any start decides nothing."""
MASKING_COORDINATES = (
    multiplicative_coordinate("bemf.scale", "left", 0.05),
    multiplicative_coordinate("bemf.scale", "right", 0.05),
    additive_coordinate("actuation.deadband", None, "duty", 0.03, low=0.0),
)
"""What no base number can stand in for, and would hide what a filter does. Without them deadbands made the
simulator's filter look like the firmware's in five of eight rehearsals, and a scale beside others the
firmware's like the simulator's."""
ROUGH_FIT_EXCESS, ROUGH_STEPS = 0.005, 8
"""Log misfit by which a fit with the columns of another may stay behind one with its own, and its steps: of
14 none did by more than 0.003."""


@dataclass(frozen=True, slots=True)
class HabitFit:
    """A fit under some habits: where it arrived, with which log misfit of the wheels. columns (coordinates,
    bins, channels): its last Jacobian."""

    log_misfit: float
    point: Point
    habits: Habits
    problem: Problem
    columns: Array

    @property
    def filter_as_specified(self) -> bool:
        """Whether the filter's time constant is inside robot.toml's deviations here: no cause is needed."""
        names = [each.settings[0][0] for each in self.problem.base]
        if BEMF_FILTER_LAG not in names:
            return True
        return abs(float(self.point.base[names.index(BEMF_FILTER_LAG)])) <= MAX_BASE_STDS

    def if_better_than(self, other: HabitFit, min_saved: float) -> HabitFit:
        """This fit where it saves so much log misfit, else the other."""
        return self if self.log_misfit < other.log_misfit - min_saved else other

    def carried_to(self, problem: Problem) -> Point:
        """Where a fit in another problem, of these coordinates or fewer, arrives with the columns of this
        one: no further from the readings than `ROUGH_FIT_EXCESS` beyond a fit with columns of its own."""
        columns = transfer_columns(self.columns, self.problem, problem)
        assert columns is not None, "other habits have coordinates of their own"
        start = transfer_point(self.point, self.problem, problem)
        whitener = _whitener(problem, start)
        return fit_with_frozen_columns(problem, whitener, [start], whitener(columns), ROUGH_STEPS)[0].point


def with_all_base_free(problem: Problem, wheels: WheelSliding) -> Problem:
    """The problem with all base numbers free, the filter's time constant among them: kept near robot.toml, a
    robot with a shorter filter would seem to have another one. It is one for both wheels, and no loop's delay
    is free: the firmware's slots could be anything then. `MASKING_COORDINATES` are free as well."""
    base = [
        each.beside(problem.neutral)
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


def choose_start(problem: Problem) -> Point:
    """The start of a fit that is nearest to the readings: with a latency, which resembles a slower filter,
    and a limit of the current. With encoders also with a longer window: a latency stands for half of it, and
    from there no fit finds back."""
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
    """The nominal point with a longer window of the encoders; none where there are none."""
    nominal = problem.nominal()
    places = [index for index, each in enumerate(problem.base) if each.settings == (WINDOW,)]
    return [
        replace(nominal, base=nominal.base + LONGER_WINDOW_STDS * np.eye(len(nominal.base))[each])
        for each in places
    ]


def fit_from(problem: Problem, start: Point, habits: Habits) -> HabitFit:
    """The fit from a start, under these habits, whose problem this is."""
    whitener = _whitener(problem, start)
    fit = fit_point(problem, whitener, start, 5)
    columns = (
        fit.jacobian.reshape(-1, *problem.features.measured.shape)
        / whitener.noise.whitening_factors[0].diagonal()
    )
    return HabitFit(log_misfit(problem, fit.point), fit.point, habits, problem, columns)


def _whitener(problem: Problem, start: Point) -> Whitener:
    """White noise, in each channel as large as the changes of a start's residual from bin to bin."""
    residual = problem.features.measured - problem.predict([start])[0]
    scale = np.maximum(np.median(np.abs(np.diff(residual, axis=0)), axis=0), problem.features.floors)
    noise = white_noise(scale, np.zeros(len(residual), np.intp))
    return Whitener.plain(noise, residual)


def log_misfit(problem: Problem, point: Point) -> float:
    """Mean over the wheels of the logarithm of their mean absolute residual over their spread."""
    features = problem.features
    residual = features.measured - problem.predict([point])[0]
    spread = np.maximum(np.std(features.measured, axis=0), features.floors)
    wheels = [index for index, role in enumerate(features.roles) if role in WHEELS]
    return float(np.log(np.abs(residual).mean(axis=0) / spread)[wheels].mean())
