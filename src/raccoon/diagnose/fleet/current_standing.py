"""The current standing of a cause since its parameter last changed: where it is present, and its sign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from raccoon.diagnose.fleet.series import Series
from raccoon.diagnose.result import ParameterResult

COMMON_SHARE = 0.6
"""Share of the recordings that can tell above which a cause is common to them."""


@dataclass(frozen=True, slots=True)
class Standing:
    """lower, higher: recordings since the last change in which the parameter is below and above the assumed
    value; if none of these names the cause any more, all such recordings. since: the recording from which
    most recordings of a robot name the cause, if most earlier ones did not. until: the last recording up to
    which most named it, if most later ones do not."""

    lower: tuple[str, ...]
    higher: tuple[str, ...]
    since: str = ""
    until: str = ""


def current_standing(
    found: Mapping[str, ParameterResult], robots: Mapping[str, str], silent: frozenset[str], series: Series
) -> Standing:
    """The current standing of a cause. found: the parameter in the recordings that name it. robots: robot of
    each recording. silent: recordings that cannot tell. `since` and `until` are only given for a single
    robot."""
    now = [each for each in _recordings_since_change(robots, series) if each in found] or [*found]
    since = until = ""
    if len({*robots.values()}) == 1 and series.courses and len(series.courses[0].pieces) > 1:
        course = series.courses[0]
        at = course.pieces[-1].first
        had, has = (
            _is_majority(each, found, silent) for each in (course.recordings[:at], course.recordings[at:])
        )
        since = course.recordings[at] if has and not had else ""
        until = course.recordings[at - 1] if had and not has else ""
    return Standing(
        tuple(each for each in now if not _is_higher(found[each])),
        tuple(each for each in now if _is_higher(found[each])),
        since,
        until,
    )


def deviation_sides(
    found: Mapping[str, ParameterResult], robots: Mapping[str, str], silent: frozenset[str], series: Series
) -> dict[str, bool]:
    """For each robot that has the cause, whether the parameter is above the assumed value. A robot has it if
    most of its recordings that can tell name it, both of all and of those since the last change, the latter
    with the same sign. What differs between runs, such as a battery's charge, is no property of a robot."""
    now, sides = _recordings_since_change(robots, series), {}
    for robot in dict.fromkeys(robots[each] for each in found):
        own = [each for each in robots if robots[each] == robot]
        late = [each for each in own if each in now]
        for higher in (True, False):
            alike = {each for each in found if _is_higher(found[each]) is higher}
            if _is_majority(own, found, silent) and _is_majority(late, alike, silent):
                sides[robot] = higher
    return sides


def _recordings_since_change(robots: Mapping[str, str], series: Series) -> list[str]:
    """The recordings of each robot since its parameter last changed; all of a robot whose parameter did
    not."""
    gone = [each.recordings[: each.pieces[-1].first] for each in series.courses]
    before = {name for names in gone for name in names}
    return [each for each in robots if each not in before]


def _is_majority(
    names: Sequence[str], having: Mapping[str, object] | set[str], silent: frozenset[str]
) -> bool:
    able = [each for each in names if each not in silent]
    return sum(each in having for each in able) >= COMMON_SHARE * max(len(able), 1)


def _is_higher(number: ParameterResult) -> bool:
    return bool(number.value > number.nominal)
