"""The measured cells as Markdown tables and as a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from raccoon.cli.compare_mitigations.claims import claims, error_percentile, goal_distance_percentile
from raccoon.cli.compare_mitigations.measure import MANOEUVRES, METHODS, Cells, End
from raccoon.cli.outputs import save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def markdown(cells: Cells, robots: Mapping[str, int]) -> str:
    """All tables, then the claims, as Markdown. robots: number in each condition."""
    counts = ", ".join(f"{name} {count}" for name, count in robots.items())
    parts = [
        f"95th percentiles: distance mm / lateral mm / heading deg / time s. Robots a column: {counts}.\n"
    ]
    for name in MANOEUVRES:
        parts += [f"### {name}\n", *_rows(cells, tuple(robots), name), ""]
    parts += ["## What the paper says\n", "| claim | measured | holds |", "|---|---|---|"]
    words = {True: "yes", False: "**no**", None: "not measured"}
    parts += [f"| {each.text} | {each.numbers} | {words[each.held]} |" for each in claims(cells)]
    return "\n".join(parts) + "\n"


def _rows(cells: Cells, conditions: tuple[str, ...], name: str) -> list[str]:
    rows = [f"| mitigation | {' | '.join(conditions)} |", "|---" * (len(conditions) + 1) + "|"]
    for method in METHODS:
        found = [cells[(method, condition, name)] for condition in conditions]
        rows.append(f"| {method} | {' | '.join(_numbers(ends) for ends in found)} |")
    return rows


def _numbers(ends: list[End]) -> str:
    distance, lateral = (1e3 * error_percentile(ends, field) for field in ("distance", "lateral"))
    return (
        f"{distance:.1f} / {lateral:.1f} / {math.degrees(error_percentile(ends, 'heading')):.1f} / "
        f"{error_percentile(ends, 'seconds'):.1f}"
    )


def draw(cells: Cells, conditions: tuple[str, ...], path: Path) -> None:
    """Draw one map per manoeuvre, by mitigation and condition: the distance from the goal in mm, for the turn
    the error in degrees."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 9.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for panel, name in zip(axes.flat, MANOEUVRES, strict=True):
        turning = name == "turn 90"
        error = _degrees_off if turning else _mm_off
        values = np.array(
            [[error(cells[method, condition, name]) for condition in conditions] for method in METHODS]
        )
        _map(panel, values, f"{name}: {'degrees off' if turning else 'mm from the goal'} (95 %)", conditions)
    save_figure(figure, path)


def _degrees_off(ends: list[End]) -> float:
    return math.degrees(error_percentile(ends, "heading"))


def _mm_off(ends: list[End]) -> float:
    return 1e3 * goal_distance_percentile(ends)


def _map(panel: Axes, values: np.ndarray, title: str, conditions: tuple[str, ...]) -> None:
    """Draw a map coloured by the logarithm of its values, with the values as text."""
    scale = np.log10(np.maximum(values, 0.05))
    panel.imshow(scale, cmap="RdYlGn_r", aspect="auto", vmin=-1.0, vmax=2.5)
    for (row, column), value in np.ndenumerate(values):
        text = f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
        colour = "black" if -0.75 < scale[row, column] < 2.0 else "white"
        panel.text(column, row, text, ha="center", va="center", fontsize=8, color=colour)
    panel.set_title(title, fontsize=10)
    panel.set_xticks(range(len(conditions)), conditions, rotation=25, ha="right", fontsize=8)
    panel.set_yticks(range(len(METHODS)), list(METHODS), fontsize=8)
