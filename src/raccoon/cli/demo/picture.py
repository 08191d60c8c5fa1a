"""The demo's picture: every path, by time and with the library."""

from __future__ import annotations

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from raccoon.cli.demo.mission import LEGS, TURNS
from raccoon.cli.demo.robots import BATTERIES, Outcome, Trial
from raccoon.model.pose import Pose

COLOURS = dict(zip(BATTERIES, ("tab:red", "tab:orange", "tab:green"), strict=True))


def draw(results: list[tuple[Trial, Outcome, Outcome]], path: Path) -> None:
    """Two panels over the same field: open loop left, closed loop right."""
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for panel, title in zip(panels, ("by time at full power", "with the library"), strict=True):
        panel.set_title(title)
        panel.set_aspect("equal")
        panel.set_xlabel("x, m")
        panel.plot(*zip(*_meant(), strict=True), color="black", linestyle=":", linewidth=3, label="meant")
    panels[0].set_ylabel("y, m")
    for trial, opened, closed in results:
        label = f"{trial.battery} V" if (trial.left, trial.right) == (0, 0) else None
        for panel, outcome in ((panels[0], opened), (panels[1], closed)):
            xs, ys = zip(*outcome.path, strict=True)
            panel.plot(xs, ys, color=COLOURS[trial.battery], linewidth=0.8, alpha=0.7, label=label)
            panel.plot(xs[-1], ys[-1], "o", color=COLOURS[trial.battery], markersize=4)
    panels[0].legend(loc="lower right")
    figure.suptitle("Three batteries, nine pairings of the paper's motors: true paths")
    figure.savefig(path, dpi=110)


def _meant() -> list[tuple[float, float]]:
    pose, corners = Pose(), [(0.0, 0.0)]
    for leg, angle in zip(LEGS, (*TURNS, 0.0), strict=True):
        pose = pose.ahead(leg).turned(angle)
        corners.append((pose.x, pose.y))
    return corners
