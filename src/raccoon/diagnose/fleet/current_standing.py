"""How a cause stands since its number last changed: who has it now, and whether too small or too large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from raccoon.diagnose.fleet.series import Series
from raccoon.diagnose.result import ParameterResult

COMMON_SHARE = 0.6
"""Of the recordings that can tell, from which a cause is said to be common to them."""


@dataclass(frozen=True, slots=True)
class Standing:
    """lower, higher: the recordings since the last change whose number is below and above what was assumed;
    where none of these names it any more, all such. since: the recording from which on most have it of a
    robot of which most before had not. until: the last one of which most had it that now have not."""

    lower: tuple[str, ...]
    higher: tuple[str, ...]
    since: str = ""
    until: str = ""


def current_standing(
    found: Mapping[str, ParameterResult], robots: Mapping[str, str], silent: frozenset[str], series: Series
) -> Standing:
    """found: the number in the recordings that name the cause. robots: whose each recording is. silent: those
    that cannot tell. When it came or went is said of one robot alone."""
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
    """For each robot with a cause, whether its number is above what was assumed: robots of which most
    recordings that can tell name it, of all and since it last changed, and then on the same side. What
    differs from run to run, as a battery's charge, is no robot's."""
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
    """The recordings of each robot since its number last changed, all of a robot whose does not."""
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
