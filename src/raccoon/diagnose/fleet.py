"""Many recordings side by side: what is common, what is one recording's own, what changed and when."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fleet_changes import Change, change_of, levels
from raccoon.diagnose.result import Diagnosis, ParameterResult, Verdict

COMMON_SHARE = 0.6
FAR = 4.0
SPREAD = 1.4826
"""Standard deviation of normal numbers over their median distance from the middle."""
FEWEST_FOR_OUTLIERS = 4
Job = TypeVar("Job")
Found = TypeVar("Found")


@dataclass(frozen=True, slots=True)
class FleetCause:
    """A cause over many recordings. share: of the recordings that can tell, those that name it. values: first
    parameter in each, in the order of the recordings that name it. outliers: recordings whose value is far
    from the others'. stds, nominal, unit: of that parameter. change: over all recordings in their order, one
    that does not name the cause counting as nominal, one that cannot tell not at all. rivals: what at least
    half of the recordings that name it do not tell it from. telling: how many can tell."""

    name: str
    share: float
    recordings: tuple[str, ...]
    values: tuple[float, ...]
    outliers: tuple[str, ...]
    stds: tuple[float, ...] = ()
    nominal: float = 0.0
    unit: str = ""
    change: Change | None = None
    rivals: tuple[str, ...] = ()
    telling: int = 0

    @property
    def common(self) -> bool:
        """Whether most recordings have it, and more than one."""
        return self.share >= COMMON_SHARE and len(self.recordings) > 1


@dataclass(frozen=True, slots=True)
class FleetNumber:
    """A number that was identified in many recordings without being a cause, such as each motor's K_E.
    recordings: those that have it. median: of all. spread: of one around what is usual, which is not the same
    before and after a change."""

    name: str
    unit: str
    median: float
    spread: float
    outliers: tuple[str, ...]
    change: Change | None
    recordings: tuple[str, ...] = ()


def diagnose_all(
    work: Callable[[Job], Found], jobs: Sequence[Job], executor: Executor | None = None
) -> list[Found]:
    """`work` for every job, in their order, on any concurrent.futures executor (it stays open) or here."""
    if executor is None:
        return [work(each) for each in jobs]
    return list(executor.map(work, jobs))


def common_causes(results: Mapping[str, Diagnosis]) -> list[FleetCause]:
    """The causes of all recordings together, most widespread first."""
    names = dict.fromkeys(cause.name for each in results.values() for cause in each.causes)
    return sorted((_fleet_cause(name, results) for name in names), key=lambda each: -each.share)


def _fleet_cause(name: str, results: Mapping[str, Diagnosis]) -> FleetCause:
    found: dict[str, ParameterResult] = {}
    for recording, diagnosis in results.items():
        for cause in diagnosis.causes:
            if cause.name == name:
                found[recording] = next(iter(cause.parameters.values()))
    units = [each.unit for each in found.values()]
    usual = max(units, key=units.count)
    silent = {key for key, each in results.items() if _silent(name, each)} - found.keys()
    telling = len(results) - len(silent)
    share = len(found) / telling
    # Where a current is missing a friction is in volts: it counts, and is not compared.
    found = {key: each for key, each in found.items() if each.unit == usual}
    first = next(iter(found.values()))
    unknown = dict.fromkeys(silent, float("nan"))
    series = [found[each].value if each in found else unknown.get(each, first.nominal) for each in results]
    stds = [found[each].std if each in found else float("nan") for each in results]
    change = change_of(series, stds)
    return FleetCause(
        name,
        share,
        tuple(found),
        tuple(each.value for each in found.values()),
        _outliers(found, list(results), series, change),
        tuple(each.std for each in found.values()),
        first.nominal,
        first.unit,
        change,
        _rivals(name, results),
        telling,
    )


def _rivals(name: str, results: Mapping[str, Diagnosis]) -> tuple[str, ...]:
    """What at least half of the recordings that name a cause do not tell it from."""
    own = [each.confounded_with for found in results.values() for each in found.causes if each.name == name]
    every = dict.fromkeys(rival for each in own for rival in each)
    return tuple(rival for rival in every if 2 * sum(rival in each for each in own) >= len(own))


CANNOT_TELL = ("not identifiable", "not visible", "not judged", "the recorded motion does not follow")
"""How a reason begins for which a recording says nothing of a cause."""


def _silent(name: str, diagnosis: Diagnosis) -> bool:
    """Whether a recording that does not name a cause does not speak against it either: it cannot tell, as
    where a channel is missing, it is of another kind, as a tophat's of a battery, or it names another cause
    that may be this one."""
    id_, _, where = name.partition("@")
    judged = [*(each.name for each in diagnosis.causes), *(each.id for each in diagnosis.rejected)]
    if diagnosis.verdict is Verdict.NOT_IDENTIFIABLE or _group(name) not in map(_group, judged):
        return True
    rivals = {
        (rival if "@" in rival or each.where != where else f"{rival}@{where}")
        for each in diagnosis.causes
        for rival in each.confounded_with
    }
    if name in rivals:
        return True
    return any(
        each.reason.startswith(CANNOT_TELL) and _of_place(each.reason, where)
        for each in diagnosis.rejected
        if each.id in (name, id_) or (each.id.endswith("*") and id_.startswith(each.id[:-1]))
    )


def _group(name: str) -> str:
    """What is judged together: battery, motor, drive, each tophat."""
    id_, _, where = name.partition("@")
    group = id_.partition(".")[0]
    return f"{group}@{where}" if where.isdecimal() else group


def _of_place(reason: str, where: str) -> bool:
    """Whether a reason holds at a place: one may say that it is of one side alone."""
    begin = "not identifiable at the "
    return not reason.startswith(begin) or reason.startswith(f"{begin}{where}:")


def _outliers(
    found: Mapping[str, ParameterResult], every: Sequence[str], series: Sequence[float], change: Change | None
) -> tuple[str, ...]:
    """Recordings whose number is far from the others'; where it jumps, from those on the same side, and where
    it creeps, from the line. every, series: all recordings and their numbers, NaN where unknown."""
    if len(found) < 2:
        return ()
    stds = np.array([each.std for each in found.values()])
    left = _off_usual(found, every, series, change)
    spread = SPREAD * float(np.median(np.abs(left)))
    far = np.abs(left) > FAR * np.sqrt(spread**2 + np.nan_to_num(stds) ** 2)
    return tuple(name for name, odd in zip(found, far, strict=True) if odd)


def _off_usual(
    found: Mapping[str, ParameterResult], every: Sequence[str], series: Sequence[float], change: Change | None
) -> NDArray[np.float64]:
    """By how much each number is off what is usual where it is in the series."""
    values = np.array([each.value for each in found.values()])
    rows = np.array([every.index(each) for each in found])
    return values - levels(rows, values, np.flatnonzero(np.isfinite(series)), change)


def fleet_numbers(results: Mapping[str, Diagnosis]) -> list[FleetNumber]:
    """What was identified in at least `FEWEST_FOR_OUTLIERS` recordings, with its spread."""
    names = dict.fromkeys(name for each in results.values() for name in each.identified)
    numbers = []
    for name in names:
        found = {key: each.identified[name] for key, each in results.items() if name in each.identified}
        units = [each.unit for each in found.values()]
        unit = max(units, key=units.count)
        found = {key: each for key, each in found.items() if each.unit == unit}
        if len(found) < FEWEST_FOR_OUTLIERS:
            continue
        values, stds = (np.array([getattr(each, key) for each in found.values()]) for key in ("value", "std"))
        series = [found[each].value if each in found else float("nan") for each in results]
        errors = [found[each].std if each in found else float("nan") for each in results]
        change = change_of(series, errors)
        spread = SPREAD * float(np.median(np.abs(_off_usual(found, list(results), series, change))))
        known = stds[np.isfinite(stds)]
        if spread == 0.0 and len(known):  # most are equal to the last digit, which says nothing of one
            spread = float(np.median(known))
        outliers = _outliers(found, list(results), series, change)
        middle = float(np.median(values))
        numbers.append(FleetNumber(name, unit, middle, spread, outliers, change, tuple(found)))
    return numbers


def fleet_dict(results: Mapping[str, Diagnosis], causes: list[FleetCause]) -> dict[str, Any]:
    """The same as plain types for JSON: every diagnosis, then what is common, odd and changed."""
    return {
        "recordings": {name: each.to_dict() for name, each in results.items()},
        "causes": [{**asdict(each), "common": each.common} for each in causes],
        "numbers": [asdict(each) for each in fleet_numbers(results)],
    }
