"""Many diagnoses as one HTML file. Needs the extra [report]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from raccoon.core.files import write_atomically
from raccoon.diagnose.fleet import FleetCause, fleet_numbers
from raccoon.diagnose.reports.fleet_text import change_lines, note_lines, told, usual_text
from raccoon.diagnose.reports.html import template
from raccoon.diagnose.reports.pictures import AFTER, BEFORE, png
from raccoon.diagnose.result import CauseResult, Diagnosis

MOST_PANELS = 8


def save_fleet_html(
    results: Mapping[str, Diagnosis],
    causes: Sequence[FleetCause],
    path: str | Path,
    failed: Mapping[str, str] | None = None,
) -> None:
    """Write the report, atomically. failed: why a recording has no diagnosis. Raises ConfigError where
    jinja2 or matplotlib is not installed."""
    page = template("fleet.html").render(
        results={name: _row(each) for name, each in results.items()},
        causes=causes,
        numbers=[(each, usual_text(each)) for each in fleet_numbers(results)],
        notes=note_lines(results),
        changes=change_lines(results, causes),
        headline=_headline(results, causes),
        picture=png(fleet_figure(results, causes)) if causes else None,
        failed=failed or {},
    )
    write_atomically(Path(path), page)


def _row(diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "verdict": str(diagnosis.verdict),
        "causes": [{"name": each.name, "short": _short(each)} for each in diagnosis.causes],
        "told": told(replace(diagnosis, causes=(), sensor_faults=())),
        "sensor_faults": diagnosis.sensor_faults,
    }


def _short(cause: CauseResult) -> str:
    first = next(iter(cause.parameters.values()))
    return f"{first.value:.3g} {first.unit}".strip()


def _headline(results: Mapping[str, Diagnosis], causes: Sequence[FleetCause]) -> str:
    common = [each.name for each in causes if each.common]
    own = [each for each in causes if not each.common]
    parts = [f"Common to most: {', '.join(common)}." if common else "No cause is common to most."]
    if own:
        parts.append(f"{len(own)} more in some recordings only.")
    broken = sum(bool(each.sensor_faults) for each in results.values())
    if broken:
        parts.append(f"{broken} with a faulty sensor.")
    return " ".join(parts)


def fleet_figure(results: Mapping[str, Diagnosis], causes: Sequence[FleetCause]) -> Any:
    """A panel a cause: its value with twice its deviation, by recording in their order."""
    from matplotlib.figure import Figure

    shown = list(causes)[:MOST_PANELS]
    names = list(results)
    figure = Figure(figsize=(8.5, 1.5 * len(shown) + 0.9), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
    for axes, cause in zip(panels, shown, strict=True):
        rows = [names.index(each) for each in cause.recordings]
        colors = [BEFORE if each in cause.outliers else AFTER for each in cause.recordings]
        stds = [2.0 * each for each in cause.stds]
        axes.errorbar(rows, cause.values, stds, fmt="none", ecolor="0.6", elinewidth=1.2, zorder=1)
        axes.scatter(rows, cause.values, 22, color=colors, zorder=2)
        axes.axhline(cause.nominal, color="0.6", linewidth=0.8, linestyle="--")
        axes.set_title(f"{cause.name}{f', {cause.unit}' if cause.unit else ''}", fontsize=9, loc="left")
        axes.set_xlim(-0.5, len(names) - 0.5)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    panels[-1].set_xticks(range(len(names)), [_label(each) for each in names], rotation=90, fontsize=8)
    return figure


def _label(name: str) -> str:
    return name if len(name) <= 24 else "..." + name[-21:]
