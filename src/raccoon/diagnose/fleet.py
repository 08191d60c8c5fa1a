"""Many recordings side by side: what is common, what is one recording's own."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from raccoon.diagnose.result import Diagnosis

COMMON_SHARE = 0.6


@dataclass(frozen=True, slots=True)
class FleetCause:
    """A cause over many recordings. share: of the recordings that name it. values: first parameter in
    each, in
    the order of the recordings that name it. outliers: recordings whose value is far from the others'."""

    name: str
    share: float
    recordings: tuple[str, ...]
    values: tuple[float, ...]
    outliers: tuple[str, ...]

    @property
    def common(self) -> bool:
        """Whether most recordings have it."""
        return self.share >= COMMON_SHARE


def common_causes(results: Mapping[str, Diagnosis]) -> list[FleetCause]:
    """The causes of all recordings together, most widespread first."""
    found: dict[str, list[tuple[str, float, float]]] = defaultdict(list)
    for recording, diagnosis in results.items():
        for cause in diagnosis.causes:
            first = next(iter(cause.parameters.values()))
            found[cause.name].append((recording, first.value, first.std))
    causes = [_fleet_cause(name, rows, len(results)) for name, rows in found.items()]
    return sorted(causes, key=lambda each: -each.share)


def _fleet_cause(name: str, rows: list[tuple[str, float, float]], count: int) -> FleetCause:
    values = np.array([value for _, value, _ in rows])
    stds = np.array([std for _, _, std in rows])
    middle = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - middle)))
    limit = 4.0 * np.sqrt(spread**2 + stds**2)
    outliers = tuple(row[0] for row, far in zip(rows, np.abs(values - middle) > limit, strict=True) if far)
    return FleetCause(
        name, len(rows) / count, tuple(row[0] for row in rows), tuple(values.tolist()), outliers
    )


def fleet_report(results: Mapping[str, Diagnosis], causes: list[FleetCause]) -> str:
    """A line a recording, then common causes with their spread and the odd ones out."""
    lines = []
    for name, diagnosis in results.items():
        named = ", ".join(each.name for each in diagnosis.causes) or "-"
        lines.append(f"{name}: {diagnosis.verdict}: {named}")
    lines.append("")
    for each in causes:
        kind = "common" if each.common else "only " + ", ".join(each.recordings)
        low, high = min(each.values), max(each.values)
        odd = f"; far from the others: {', '.join(each.outliers)}" if each.outliers else ""
        lines.append(f"{each.name}: {100 * each.share:.0f} % ({kind}), {low:.4g} to {high:.4g}{odd}")
    return "\n".join(lines)
