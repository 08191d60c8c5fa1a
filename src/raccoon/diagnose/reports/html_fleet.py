"""Report of many diagnoses as one HTML file. Needs the extra [report]."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from raccoon.core.files import write_atomically
from raccoon.diagnose.fleet.common_model import CrossCheck
from raccoon.diagnose.fleet.summary import Fleet
from raccoon.diagnose.reports.fleet_text import (
    change_lines,
    count_text,
    explanation_lines,
    findings_text,
    kind_text,
    kind_with_reason_text,
    note_lines,
    outliers_text,
    robot_suffix,
    typical_value_text,
)
from raccoon.diagnose.reports.html import load_template
from raccoon.diagnose.reports.pictures import AFTER, BEFORE, figure_to_base64_png
from raccoon.diagnose.reports.plain_names import capitalise, plain_name, plain_names
from raccoon.diagnose.result import CauseResult, Diagnosis

MAX_PANELS = 8
MAX_LABELS = 60
"""Largest number of names below a figure; of more recordings only every second, third, ... is named."""
MAX_HEADLINE_NAMES = 2
"""Largest number of recordings that a headline names."""
MAX_HEADLINE_CAUSES = 3
"""Largest number of causes in the headline that are not common and given with their recordings."""


def save_fleet_html(
    fleet: Fleet,
    path: str | Path,
    failed: Mapping[str, str] | None = None,
    seen: Mapping[str, CrossCheck] | None = None,
) -> None:
    """Write the report, atomically. failed: reason for each recording without a diagnosis. seen: cross check
    of each recording with the model of the others. Raises ConfigError if jinja2 or matplotlib is not
    installed."""
    page = load_template("fleet.html").render(
        results={f"{name}{robot_suffix(fleet, name)}": _row(each) for name, each in fleet.results.items()},
        causes=[
            (
                each,
                kind_with_reason_text(each, fleet),
                count_text(each),
                explanation_lines(each, fleet),
                outliers_text(each),
                capitalise(plain_name(each.name)),
                plain_names(each.rivals),
            )
            for each in fleet.causes
        ],
        numbers=[(each, typical_value_text(each), outliers_text(each)) for each in fleet.numbers],
        notes=note_lines(fleet.results),
        changes=change_lines(fleet),
        headline=_headline(fleet, len(failed or {})),
        picture=figure_to_base64_png(fleet_figure(fleet)) if fleet.causes else None,
        failed=failed or {},
        seen={name: (each, plain_names(each.still)) for name, each in (seen or {}).items()},
    )
    write_atomically(Path(path), page)


def _row(diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "verdict": str(diagnosis.verdict),
        "causes": [
            {"name": plain_name(each.name), "short": _first_number_text(each)} for each in diagnosis.causes
        ],
        "told": findings_text(replace(diagnosis, causes=(), sensor_faults=())),
        "sensor_faults": diagnosis.sensor_faults,
    }


def _first_number_text(cause: CauseResult) -> str:
    first = next(iter(cause.parameters.values()))
    return f"{first.value:.3g} {first.unit}".strip()


def _headline(fleet: Fleet, failed: int) -> str:
    common = [plain_name(each.name) for each in fleet.causes if each.common]
    own = [each for each in fleet.causes if not each.common]
    whom = "robots" if len(fleet.names) > 1 else "recordings"
    parts = [
        f"Common to most {whom}: {', '.join(common)}." if common else f"No cause is common to most {whom}."
    ]
    parts += [
        f"{capitalise(plain_name(each.name))}: "
        f"{kind_text(each, fleet, MAX_HEADLINE_NAMES).removeprefix('some: ')}."
        for each in own[:MAX_HEADLINE_CAUSES]
    ]
    if len(own) > MAX_HEADLINE_CAUSES:
        parts.append(f"{len(own) - MAX_HEADLINE_CAUSES} more in some {whom} only.")
    broken = sum(bool(each.sensor_faults) for each in fleet.results.values())
    if broken:
        parts.append(f"{broken} with a faulty sensor.")
    if failed:
        parts.append(f"{failed} without a diagnosis.")
    return " ".join(parts)


def fleet_figure(fleet: Fleet) -> Any:
    """A panel for each cause: its value with two standard deviations over the recordings in order, an open
    marker for a refitted value that is not named, and a line for changes."""
    from matplotlib.figure import Figure

    shown = fleet.causes[:MAX_PANELS]
    names = list(fleet.results)
    figure = Figure(figsize=(8.5, 1.5 * len(shown) + 0.9), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
    for axes, cause in zip(panels, shown, strict=True):
        rows = [names.index(each) for each in cause.recordings]
        odd = {each for each in names if {each, f"robot {fleet.robots[each]}"} & {*cause.series.outliers}}
        colors = [BEFORE if each in odd else AFTER for each in cause.recordings]
        stds = [2.0 * each for each in cause.stds]
        for course in cause.series.courses:
            for piece in course.pieces:
                ends = [names.index(course.recordings[each]) for each in (piece.first, piece.last)]
                axes.plot(ends, (piece.start, piece.end), color=AFTER, linewidth=1.0, alpha=0.6, zorder=0)
        axes.errorbar(rows, cause.values, stds, fmt="none", ecolor="0.6", elinewidth=1.2, zorder=1)
        axes.scatter(rows, cause.values, 22, color=colors, zorder=2)
        refitted = [names.index(each) for each in cause.refitted]
        axes.scatter(refitted, cause.refitted.values(), 14, "none", edgecolors=AFTER)
        axes.axhline(cause.nominal, color="0.6", linewidth=0.8, linestyle="--")
        unit = f", {cause.unit}" if cause.unit else ""
        axes.set_title(f"{capitalise(plain_name(cause.name))}{unit}", fontsize=9, loc="left")
        axes.set_xlim(-0.5, len(names) - 0.5)
        for before, after in pairwise(range(len(names))):
            if fleet.robots[names[before]] != fleet.robots[names[after]]:
                axes.axvline(before + 0.5, color="0.85", linewidth=0.8, zorder=0)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    step = math.ceil(len(names) / MAX_LABELS)
    labels = [_label(each) for each in names[::step]]
    panels[-1].set_xticks(range(0, len(names), step), labels, rotation=90, fontsize=8)
    return figure


def _label(name: str) -> str:
    """The shortened name of a recording as a tick label, with $ escaped (no formula) and undecodable bytes
    spelled out."""
    name = name.encode("utf-8", "backslashreplace").decode()
    short = name if len(name) <= 24 else "..." + name[-21:]
    return short.replace("$", r"\$")
