"""Errors of dead reckoning with factors on wheels and track width, and the factors that are candidate
causes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.hypotheses.coordinates import cause_name
from raccoon.diagnose.recordings.reference.stretches import stretch_starts
from raccoon.estimate.drive_calibration.columns import Manoeuvre
from raccoon.estimate.drive_calibration.paths import shape_residuals, truth_residuals

Array = NDArray[np.float64]

MIN_SIGMAS = 3.0
"""Least difference of a cause's factor from the configured value, in standard deviations."""
MIN_FACTOR_CHANGE = 0.001
"""Largest change of a factor that is no cause: a wheel's radius is known to 0.1 % at best."""


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Pooled root mean square errors: position, m; heading, rad."""

    position: float
    heading: float


@dataclass(frozen=True, slots=True)
class GeometryFit:
    """Fitted factors (3,) on left distance, right distance and track width, with stds; the fitted and
    held-out runs."""

    robot: RobotConfig
    factors: Array
    stds: Array
    fitted: Sequence[Manoeuvre]
    heldout: Sequence[Manoeuvre]

    def errors(self, factors: Array, from_start: bool = True) -> PoseErrors:
        """Errors over the held-out runs, each started at the reference's pose (from_start) or at the
        best-fitting pose."""
        residuals_of = truth_residuals if from_start else shape_residuals
        residuals = [residuals_of(factors, self.robot, each) for each in self.heldout]
        errors = np.concatenate(residuals)
        return PoseErrors(
            float(np.sqrt((errors[:, :2] ** 2).sum(axis=1).mean())),
            float(np.sqrt((errors[:, 2] ** 2).mean())),
        )


DEPARTURE_WINDOW_S = 1.0
"""Time over which the departure of a robot from its wheels' path is measured, s."""


def describe_departure(fit: GeometryFit, factors: Array) -> str:
    """A sentence on the largest departure of the held-out runs from the paths of their wheels."""
    largest, when = 0.0, 0.0
    for each in fit.heldout:
        errors, time = truth_residuals(factors, fit.robot, each), each.t[each.known_rows]
        ends = stretch_starts(time, time[0], time[-1], 0.25 * DEPARTURE_WINDOW_S)
        later = np.minimum(np.searchsorted(time, time[ends] + DEPARTURE_WINDOW_S), len(time) - 1)
        moved = errors[later] - errors[ends]
        departures = np.hypot(moved[:, 0], moved[:, 1])
        worst = int(np.argmax(departures))
        if departures[worst] > largest:
            largest, when = float(departures[worst]), float(time[ends[worst]])
    return (
        f"from {when:.1f} s on the robot deviates from the path of its wheels by {1000 * largest:.0f} mm "
        f"within {DEPARTURE_WINDOW_S:.0f} s, which no wheel size explains: was it held or pushed, or did it "
        "slip?"
    )


@dataclass(frozen=True, slots=True)
class Candidate:
    """A factor that may be a cause. factors (3,): its effect on left, right and track."""

    id: str
    where: str | None
    factor: float
    std: float
    factors: Array

    @property
    def name(self) -> str:
        return cause_name(self.id, self.where)

    @property
    def is_significant(self) -> bool:
        return abs(self.factor - 1.0) > max(MIN_SIGMAS * self.std, MIN_FACTOR_CHANGE)


def candidates(fit: GeometryFit) -> list[Candidate]:
    """The candidate factors: of the track, and of both wheels; or of each wheel if the two differ
    significantly."""
    left, right, track = (float(each) for each in fit.factors)
    left_std, right_std, track_std = (float(each) for each in fit.stds)
    found = [Candidate("drive.track_width", None, track, track_std, np.array([1.0, 1.0, track]))]
    if abs(left - right) > MIN_SIGMAS * math.hypot(left_std, right_std):
        found.append(Candidate("drive.wheel_radius", "left", left, left_std, np.array([left, 1.0, 1.0])))
        found.append(Candidate("drive.wheel_radius", "right", right, right_std, np.array([1.0, right, 1.0])))
    else:
        mean = 0.5 * (left + right)
        found.append(
            Candidate(
                "drive.wheel_radius", None, mean, 0.5 * (left_std + right_std), np.array([left, right, 1.0])
            )
        )
    return found


def combine_factors(parts: Sequence[Candidate]) -> Array:
    """Product of the factors (3,) of these candidates."""
    return np.asarray(np.prod([np.ones(3), *(each.factors for each in parts)], axis=0))
