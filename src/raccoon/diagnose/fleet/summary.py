"""Summary of many recordings: common causes, those of single robots or recordings, and changes over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Any

from raccoon.diagnose.fleet.change_points import Piece
from raccoon.diagnose.fleet.current_standing import COMMON_SHARE, Standing, current_standing, deviation_sides
from raccoon.diagnose.fleet.refitted_values import refitted_values
from raccoon.diagnose.fleet.series import MIN_FOR_OUTLIERS, Course, Series, make_series
from raccoon.diagnose.fleet.silent_recordings import is_silent
from raccoon.diagnose.result import Diagnosis, ParameterResult
from raccoon.model.reflectance import MIN_HEIGHT, height_doubt

HEIGHT = "tophat.height"


@dataclass(frozen=True, slots=True)
class FleetCause:
    """A cause over many recordings.

    share: of the recordings that can tell, those that name it. recordings: those that name it with its
    parameter in `unit`; values, stds: the cause's first parameter in each of them. series: over all
    recordings; one that does not name the cause has the refitted value, one that cannot tell has none.
    rivals: causes that at least half of the recordings that name it do not distinguish from it. telling:
    number of recordings that can tell. robots: those that have it: most of their recordings that can tell
    name it, also since the last change, with the same sign. alike: number of these robots that agree in the
    sign. of_robots: number of robots with a recording that can tell. standing: since the last change.
    refitted: the parameter in recordings that can tell and do not name it (for figures; not in the JSON).
    instead: a rival, named in at least as many recordings, for which this cause is named in others.
    """

    name: str
    share: float
    recordings: tuple[str, ...]
    values: tuple[float, ...]
    stds: tuple[float, ...]
    nominal: float
    unit: str
    series: Series
    rivals: tuple[str, ...]
    telling: int
    robots: tuple[str, ...]
    alike: int
    of_robots: int
    standing: Standing
    refitted: Mapping[str, float]
    instead: str = ""

    @property
    def common(self) -> bool:
        """Whether it is common: most robots have it, or, with a single robot, most recordings and more than
        one."""
        if self.instead:
            return False
        if self.of_robots > 1:
            return 1 < self.alike >= COMMON_SHARE * self.of_robots
        return bool(self.robots) and len(self.recordings) > 1


@dataclass(frozen=True, slots=True)
class FleetNumber:
    """A quantity that many recordings identified without naming it as a cause, such as each motor's K_E.
    recordings: those that have it. median: over all of them."""

    name: str
    unit: str
    median: float
    series: Series
    recordings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Fleet:
    """Diagnoses by recording, and their summary. robots: robot of each recording, a single one by default.
    causes: most widespread first."""

    results: Mapping[str, Diagnosis]
    robots: Mapping[str, str]
    causes: tuple[FleetCause, ...]
    numbers: tuple[FleetNumber, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The robots in order of their first recording."""
        return tuple(dict.fromkeys(self.robots.values()))

    @property
    def courses(self) -> list[tuple[FleetCause | FleetNumber, Course]]:
        """Every cause or number that changes, with its course for each robot."""
        every: list[FleetCause | FleetNumber] = [*self.causes, *self.numbers]
        return [(each, course) for each in every for course in each.series.courses]

    def to_dict(self) -> dict[str, Any]:
        """Plain types for JSON: every diagnosis, then causes and numbers with outliers and changes."""
        return {
            "recordings": {name: each.to_dict() for name, each in self.results.items()},
            "robots": {each: [it for it, own in self.robots.items() if own == each] for each in self.names},
            "causes": [{**_to_plain_dict(each), "common": each.common} for each in self.causes],
            "numbers": [_to_plain_dict(each) for each in self.numbers],
        }


def fleet_of(results: Mapping[str, Diagnosis], robots: Mapping[str, str] | None = None) -> Fleet:
    """The fleet of all recordings, in their order. robots: name of each recording's robot, if there are
    several."""
    whose = {name: "" if robots is None else robots[name] for name in results}
    names = dict.fromkeys(cause.name for each in results.values() for cause in each.causes)
    causes = sorted((_make_cause(name, results, whose) for name in names), key=lambda each: -each.share)
    causes = [replace(each, instead=_more_common_rival(each, causes)) for each in causes]
    return Fleet(results, whose, tuple(causes), tuple(_make_numbers(results, whose)))


def _more_common_rival(cause: FleetCause, causes: Sequence[FleetCause]) -> str:
    """The more common cause in place of which this one is named, "" if there is none: if recordings cannot
    distinguish two causes, some name one and some the other, but a robot has only one of them."""
    own, where = {*cause.recordings}, cause.name.partition("@")[2]
    rivals = {*cause.rivals, *(f"{each}@{where}" for each in cause.rivals if where and "@" not in each)}
    ahead = sorted(causes, key=lambda each: -len(each.recordings))
    for each in ahead[: ahead.index(cause)]:
        if each.name in rivals and 2 * len(own.intersection(each.recordings)) < len(own):
            return each.name
    return ""


def _make_cause(name: str, results: Mapping[str, Diagnosis], robots: Mapping[str, str]) -> FleetCause:
    found: dict[str, ParameterResult] = {}
    for recording, diagnosis in results.items():
        for cause in diagnosis.causes:
            if cause.name == name:
                found[recording] = next(iter(cause.parameters.values()))
    silent = frozenset(key for key, each in results.items() if is_silent(name, each)) - found.keys()
    able = [robots[each] for each in results if each not in silent]
    # Without a measured current a friction is in volts: it counts as named, but its value is not compared.
    alike = _of_most_common_unit(found)
    first = next(iter(alike.values()))
    refits, unsaid = refitted_values(name, results), silent | (found.keys() - alike.keys())
    series = make_series(_with_comparable_stds(name, alike), robots, unsaid, refits)
    sides = deviation_sides(found, robots, silent, series)
    return FleetCause(
        name,
        len(found) / len(able),
        tuple(alike),
        tuple(each.value for each in alike.values()),
        tuple(each.std for each in alike.values()),
        first.nominal,
        first.unit,
        series,
        _common_rivals(name, results),
        len(able),
        tuple(sides),
        max(map([*sides.values()].count, sides.values()), default=0),
        len(set(able)),
        current_standing(alike, robots, silent, series),
        {key: value for key, (value, _) in refits.items() if key not in found and key not in silent},
    )


def _with_comparable_stds(name: str, found: Mapping[str, ParameterResult]) -> Mapping[str, ParameterResult]:
    """The values with standard deviations relative to each other: the uncertainty of the law of a tophat's
    light is common to all, and does not shift one height against another."""
    if name.partition("@")[0] != HEIGHT:
        return found

    def own(number: ParameterResult) -> float:
        doubt = height_doubt(max(number.value, MIN_HEIGHT))
        return math.sqrt(max(number.std**2 - doubt**2, 0.0))

    return {key: replace(each, std=own(each)) for key, each in found.items()}


def _of_most_common_unit(found: Mapping[str, ParameterResult]) -> dict[str, ParameterResult]:
    units = [each.unit for each in found.values()]
    usual = max(units, key=units.count)
    return {key: each for key, each in found.items() if each.unit == usual}


def _common_rivals(name: str, results: Mapping[str, Diagnosis]) -> tuple[str, ...]:
    """Causes that at least half of the recordings that name this one do not distinguish from it."""
    own = [each.confounded_with for found in results.values() for each in found.causes if each.name == name]
    every = dict.fromkeys(rival for each in own for rival in each)
    return tuple(rival for rival in every if 2 * sum(rival in each for each in own) >= len(own))


def _make_numbers(results: Mapping[str, Diagnosis], robots: Mapping[str, str]) -> list[FleetNumber]:
    """Numbers that were identified in at least `MIN_FOR_OUTLIERS` recordings."""
    names = dict.fromkeys(name for each in results.values() for name in each.identified)
    numbers = []
    for name in names:
        found = _of_most_common_unit(
            {key: each.identified[name] for key, each in results.items() if name in each.identified}
        )
        if len(found) < MIN_FOR_OUTLIERS:
            continue
        middle = median(each.value for each in found.values())
        unit = next(iter(found.values())).unit
        numbers.append(FleetNumber(name, unit, middle, make_series(found, robots), tuple(found)))
    return numbers


def _to_plain_dict(each: FleetCause | FleetNumber) -> dict[str, Any]:
    """A dict with the fields of the series merged in, and names of recordings in place of rows."""
    table = asdict(each)
    series, _ = table.pop("series"), table.pop("refitted", None)
    courses = [_course_to_dict(course) for course in each.series.courses]
    return {**table, **series, "courses": courses}


def _course_to_dict(course: Course) -> dict[str, Any]:
    def piece(each: Piece) -> dict[str, Any]:
        return {
            "first": course.recordings[each.first],
            "last": course.recordings[each.last],
            "start": each.start,
            "end": each.end,
        }

    return {"robot": course.robot, "pieces": [piece(each) for each in course.pieces]}
