"""Many recordings side by side: what is common, what is one recording's own, what changed and when."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np

from raccoon.diagnose.fleet_changes import Change, Form, change_of, levels
from raccoon.diagnose.result import Diagnosis, ParameterResult, Verdict

COMMON_SHARE = 0.6
FAR = 4.0
SPREAD = 1.4826
"""Standard deviation of normal numbers over their median distance from the middle."""
FEWEST_FOR_OUTLIERS = 4
WORN: Mapping[str, str] = {
    "battery.internal_resistance": "a battery ages",
    "battery.open_circuit_voltage": "another charge, or another battery",
    "motor.back_emf_constant": "a motor was replaced, or its magnets suffered",
    "motor.armature_resistance": "a motor was replaced, or its brushes wear",
    "friction.coulomb": "bearings, gears or the floor",
    "drive.wheel_radius": "a wheel was replaced or its tyre wears",
    "drive.backlash": "gears wear",
}
"""What is behind a change, by cause."""

Job = TypeVar("Job")
Found = TypeVar("Found")


@dataclass(frozen=True, slots=True)
class FleetCause:
    """A cause over many recordings. share: of the recordings that can tell, those that name it. values: first
    parameter in each, in the order of the recordings that name it. outliers: recordings whose value is far
    from the others'. stds, nominal, unit: of that parameter. change: over all recordings in their order, one
    that does not name the cause counting as nominal, one that cannot tell not at all. rivals: what at least
    half of the recordings that name it do not tell it from."""

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

    @property
    def common(self) -> bool:
        """Whether most recordings have it."""
        return self.share >= COMMON_SHARE


@dataclass(frozen=True, slots=True)
class FleetNumber:
    """A number that was identified in many recordings without being a cause, such as each motor's K_E."""

    name: str
    unit: str
    median: float
    spread: float
    outliers: tuple[str, ...]
    change: Change | None


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
    share = len(found) / (len(results) - len(silent))
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
    where a channel is missing, or it names another that may be this one."""
    id_, _, where = name.partition("@")
    if diagnosis.verdict is Verdict.NOT_IDENTIFIABLE:
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
    values, stds = (np.array([getattr(each, key) for each in found.values()]) for key in ("value", "std"))
    rows = np.array([every.index(each) for each in found])
    left = values - levels(rows, values, np.flatnonzero(np.isfinite(series)), change)
    spread = SPREAD * float(np.median(np.abs(left)))
    far = np.abs(left) > FAR * np.sqrt(spread**2 + np.nan_to_num(stds) ** 2)
    return tuple(name for name, odd in zip(found, far, strict=True) if odd)


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
        middle = float(np.median(values))
        spread = SPREAD * float(np.median(np.abs(values - middle)))
        known = stds[np.isfinite(stds)]
        if spread == 0.0 and len(known):  # most are equal to the last digit, which says nothing of one
            spread = float(np.median(known))
        series = [found[each].value if each in found else float("nan") for each in results]
        errors = [found[each].std if each in found else float("nan") for each in results]
        change = change_of(series, errors)
        outliers = _outliers(found, list(results), series, change)
        numbers.append(FleetNumber(name, unit, middle, spread, outliers, change))
    return numbers


def fleet_report(results: Mapping[str, Diagnosis], causes: list[FleetCause]) -> str:
    """A line a recording, then common causes with their spread, the odd ones out, and what changed."""
    lines = []
    for name, diagnosis in results.items():
        named = ", ".join(each.name for each in diagnosis.causes) or "-"
        broken = "".join(f"; {each.channel} is {each.fault}" for each in diagnosis.sensor_faults)
        lines.append(f"{name}: {diagnosis.verdict}: {named}{broken}")
    lines.append("")
    lines += [_cause_line(each, len(results)) for each in causes]
    numbers = fleet_numbers(results)
    if numbers:
        lines += ["", "Measured in all of them (median, spread of one):"]
        lines += [_number_line(each) for each in numbers]
    changes = change_lines(results, causes)
    if changes:
        lines += ["", "What changed:", *(f"  {each}" for each in changes)]
    return "\n".join(lines)


def change_lines(results: Mapping[str, Diagnosis], causes: Sequence[FleetCause]) -> list[str]:
    """A line for everything that jumps or creeps in the order of the recordings."""
    every: list[FleetCause | FleetNumber] = [*causes, *fleet_numbers(results)]
    names = list(results)
    return [
        _change_line(_one_of(each), each.unit, each.change, WORN.get(each.name.partition("@")[0]), names)
        for each in every
        if each.change
    ]


def _one_of(each: FleetCause | FleetNumber) -> str:
    """Its name, with those of what may be it: what changes is known then, and not which of them it is."""
    rivals = each.rivals if isinstance(each, FleetCause) else ()
    return f"{each.name} (or {', '.join(rivals)})" if rivals else each.name


def _cause_line(each: FleetCause, count: int) -> str:
    if each.common:
        kind = "common"
    elif len(each.recordings) <= max(1, count // 5):
        kind = "only " + ", ".join(each.recordings)
    else:
        kind = "some: " + ", ".join(each.recordings)
    low, high = min(each.values), max(each.values)
    odd = f"; far from the others: {', '.join(each.outliers)}" if each.outliers else ""
    unit = f" {each.unit}" if each.unit else ""
    alike = f"; not told from {', '.join(each.rivals)}" if each.rivals else ""
    return f"{each.name}: {100 * each.share:.0f} % ({kind}), {low:.4g} to {high:.4g}{unit}{odd}{alike}"


def _number_line(each: FleetNumber) -> str:
    odd = f"; far from the others: {', '.join(each.outliers)}" if each.outliers else ""
    return f"  {each.name:28s} {each.median:10.4g} +- {each.spread:.2g} {each.unit}{odd}"


def _change_line(name: str, unit: str, change: Change, why: str | None, recordings: Sequence[str]) -> str:
    behind = f" ({why}?)" if why else ""
    pair = f"{change.before:.4g} to {change.after:.4g} {unit}".strip()
    if change.form is Form.STEP:
        return f"{name} jumps from {pair} with {recordings[change.first]}{behind}"
    return f"{name} creeps from {pair} over the recordings{behind}"


def fleet_dict(results: Mapping[str, Diagnosis], causes: list[FleetCause]) -> dict[str, Any]:
    """The same as plain types for JSON: every diagnosis, then what is common, odd and changed."""
    return {
        "recordings": {name: each.to_dict() for name, each in results.items()},
        "causes": [{**asdict(each), "common": each.common} for each in causes],
        "numbers": [asdict(each) for each in fleet_numbers(results)],
    }
