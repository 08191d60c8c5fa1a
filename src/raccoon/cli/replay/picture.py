"""Picture of replayed drives: the estimate with its uncertainty, over the truth if there is one."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.outputs import save_figure
from raccoon.cli.replay.drive import Drive
from raccoon.trace.pose_error import field_truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_RUNS = 16
"""Largest number of drives in one picture; more could not be distinguished."""


def draw(drives: list[Drive], path: Path) -> None:
    """Draw the paths side by side (m, x to the right) and write them to a file in the format that its ending
    names."""
    from matplotlib.figure import Figure

    shown = drives[:MAX_RUNS]
    columns = math.ceil(math.sqrt(len(shown)))
    rows = math.ceil(len(shown) / columns)
    # A figure of its own: no global state, no window.
    figure = Figure(figsize=(4.5 * columns, 4.0 * rows + 0.3), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(shown) :]:
        axes.set_visible(False)
    for axes, drive in zip(grid.flat, shown, strict=False):
        _draw_one(axes, drive)
    if len(drives) > MAX_RUNS:
        figure.suptitle(f"the first {MAX_RUNS} of {len(drives)} runs")
    save_figure(figure, path, dpi=120)


def _draw_one(axes: Axes, drive: Drive) -> None:
    title = drive.run.name
    if drive.error is not None:
        true_x, true_y, _ = field_truth(drive.run.recording)
        axes.plot(true_x, true_y, color="0.7", linewidth=4.0, label="truth")  # shows below the odometry
        title += (
            f"\noff by {1000 * drive.error.rms:.1f} mm (rms), {1000 * drive.error.final:.1f} mm at the end"
        )
    x, y = drive.estimate["x"], drive.estimate["y"]
    axes.plot(x, y, color="tab:orange", linewidth=1.2, label="odometry")
    if len(x):
        spread = 2.0 * math.hypot(drive.estimate["x_std"][-1], drive.estimate["y_std"][-1])
        axes.errorbar(
            x[-1], y[-1], xerr=spread, yerr=spread, color="tab:orange", capsize=2, label="end, 2 sd"
        )
    axes.set(xlabel="x, m", ylabel="y, m")
    axes.set_title(title, fontsize="medium")
    axes.set_aspect("equal", adjustable="datalim")  # a straight drive leaves room for the legend
    axes.legend(fontsize="small")
