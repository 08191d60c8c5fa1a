"""A parameter over the recordings of one or several robots: its changes per robot, and outliers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fleet.change_points import Piece, fit_pieces, typical_values
from raccoon.diagnose.fleet.refitted_values import ValueWithStd
from raccoon.diagnose.result import ParameterResult

Array = NDArray[np.float64]

OUTLIER_STDS = 4.0
"""Distance, in standard deviations, above which a value is an outlier."""
STD_PER_MAD = 1.4826
"""Ratio of standard deviation and median absolute deviation of a normal distribution."""
MIN_FOR_OUTLIERS = 4
"""Least number of values, or of robots, for a search of outliers."""


@dataclass(frozen=True, slots=True)
class Course:
    """The course of a parameter over a robot's recordings. pieces: their rows index `recordings`, which are
    all of the robot's."""

    robot: str
    recordings: tuple[str, ...]
    pieces: tuple[Piece, ...]


@dataclass(frozen=True, slots=True)
class Series:
    """A parameter in the recordings that have it. courses: of robots whose value changes. levels: median of
    each robot. spread: standard deviation of a single value around its typical value. outliers: recordings,
    and robots ("robot NAME"), whose value is an outlier."""

    courses: tuple[Course, ...]
    levels: Mapping[str, float]
    spread: float
    outliers: tuple[str, ...]


def make_series(
    found: Mapping[str, ParameterResult],
    robots: Mapping[str, str],
    silent: frozenset[str] | None = None,
    refits: Mapping[str, ValueWithStd] | None = None,
) -> Series:
    """The series of a parameter. found: its values by recording. robots: the robot of each recording of the
    fleet, in order. silent: recordings that cannot tell; any other recording without a value has the refitted
    one (refits), or else its robot's nominal one. silent is None if recordings without a value show
    nothing."""
    courses, levels = [], {}
    off: dict[str, float] = {}
    for robot in dict.fromkeys(robots[each] for each in found):
        own = tuple(each for each in robots if robots[each] == robot)
        rows = np.array([row for row, each in enumerate(own) if each in found])
        values = np.array([found[own[row]].value for row in rows])
        series, stds = _values_and_stds(own, found, silent, refits or {})
        pieces = fit_pieces(series.tolist(), stds.tolist())
        if pieces:
            courses.append(Course(robot, own, pieces))
        left = values - typical_values(rows, values, np.flatnonzero(np.isfinite(series)), pieces)
        off |= {own[row]: float(each) for row, each in zip(rows, left, strict=True)}
        levels[robot] = float(np.median(values))
    odd_robots = []
    if len(levels) == len(found):  # one value per robot: robots are compared with each other
        middle = float(np.median([*levels.values()]))
        off = {each: found[each].value - middle for each in off}
    else:
        odd_robots = [f"robot {each}" for each in _outlier_robots(found, robots, levels)]
    stds = np.array([found[each].std for each in off])
    spread = STD_PER_MAD * float(np.median(np.abs([*off.values()])))
    odd = [each for each, far in zip(off, _are_outliers([*off.values()], spread, stds), strict=True) if far]
    if (
        spread == 0.0 and np.isfinite(stds).any()
    ):  # most values are equal to the last digit, so the scatter is unknown
        spread = float(np.nanmedian(stds))
    return Series(
        tuple(courses), levels, spread, (*(odd if len(found) >= MIN_FOR_OUTLIERS else ()), *odd_robots)
    )


def _are_outliers(left: Sequence[float], spread: float, stds: Array) -> list[bool]:
    """Flags of residuals that are larger than the spread and their own standard deviation explain."""
    return list(np.abs(left) > OUTLIER_STDS * np.hypot(spread, np.nan_to_num(stds)))


def _values_and_stds(
    own: Sequence[str],
    found: Mapping[str, ParameterResult],
    silent: frozenset[str] | None,
    refits: Mapping[str, ValueWithStd],
) -> tuple[Array, Array]:
    """Value and standard deviation in each of a robot's recordings, NaN if unknown. A recording that does not
    name the cause has the median standard deviation of those that do."""
    having = [found[each] for each in own if each in found]
    nominal = having[0].nominal
    usual = float(np.median(np.nan_to_num(np.array([each.std for each in having]))))

    def number(name: str) -> tuple[float, float]:
        if name in found:
            return found[name].value, found[name].std
        told = silent is not None and name not in silent
        return refits.get(name, (nominal, usual)) if told else (math.nan, math.nan)

    values, stds = zip(*map(number, own), strict=True)
    return np.array(values), np.array(stds)


def _outlier_robots(
    found: Mapping[str, ParameterResult], robots: Mapping[str, str], levels: Mapping[str, float]
) -> list[str]:
    """Robots whose median is an outlier among the robots; none if there are too few."""
    if len(levels) < MIN_FOR_OUTLIERS:
        return []
    left = np.array([*levels.values()]) - np.median([*levels.values()])
    spread = STD_PER_MAD * float(np.median(np.abs(left)))
    own = np.array([_median_std([found[name] for name in found if robots[name] == each]) for each in levels])
    return [each for each, far in zip(levels, _are_outliers(left.tolist(), spread, own), strict=True) if far]


def _median_std(numbers: Sequence[ParameterResult]) -> float:
    """Standard deviation of a robot's median, by the larger of the recordings' own standard deviations and
    their scatter."""
    values = np.array([each.value for each in numbers])
    said = float(np.nan_to_num(np.array([each.std for each in numbers])).mean())
    scatter = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    return max(said, scatter) / math.sqrt(len(values))
