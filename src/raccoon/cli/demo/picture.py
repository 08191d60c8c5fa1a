"""The demo's picture: all paths, by time and with the library."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.patches import Circle

from raccoon.cli.demo.mission import DISTANCE, LEGS, TURNS, goal
from raccoon.cli.demo.robots import BATTERIES, Outcome, Trial
from raccoon.cli.outputs import save_figure
from raccoon.model.pose import Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = dict(zip(BATTERIES, ("tab:red", "tab:orange", "tab:green"), strict=True))
ZOOM = 0.003  # m either way of the mark, in the inset
Results = list[tuple[Trial, Outcome, Outcome]]


def draw(results: Results, path: Path) -> None:
    """Draw two panels of the same field, open loop left and closed loop right with an inset of the goal, to a
    file."""
    figure = Figure(figsize=(12.0, 4.6), layout="constrained")
    opened, closed = figure.subplots(1, 2, sharex=True, sharey=True)
    _field(opened, [(trial, outcome) for trial, outcome, _ in results], "by time, at full power")
    _field(closed, [(trial, outcome) for trial, _, outcome in results], "with raccoon")
    opened.set_ylabel("y, m")
    opened.legend(loc="lower right", fontsize="small", framealpha=1.0)
    _near(closed, [(trial, outcome) for trial, _, outcome in results])
    figure.suptitle(
        f"One program on {len(results)} robots: three batteries, the paper's three motors in every pairing",
        fontsize=12,
    )
    save_figure(figure, path, dpi=110)


def _field(panel: Axes, outcomes: list[tuple[Trial, Outcome]], title: str) -> None:
    """Draw all true paths of one kind of driving, and the intended one."""
    worst = max(outcome.end for _, outcome in outcomes)
    digits = 1 if worst < 0.01 else 0
    panel.set_title(f"{title}: up to {1e3 * worst:.{digits}f} mm from the mark", fontsize=11)
    panel.set_aspect("equal")
    panel.set_xlabel("x, m")
    panel.grid(alpha=0.25)
    panel.plot(*zip(*_meant(), strict=True), color="black", linestyle=":", linewidth=3, label="meant")
    for trial, outcome in outcomes:
        label = f"{trial.battery} V" if (trial.left, trial.right) == (0, 0) else None
        xs, ys = zip(*outcome.path, strict=True)
        panel.plot(xs, ys, color=COLOURS[trial.battery], linewidth=0.9, alpha=0.75, label=label)
        panel.plot(xs[-1], ys[-1], "o", color=COLOURS[trial.battery], markersize=4)


def _near(panel: Axes, outcomes: list[tuple[Trial, Outcome]]) -> None:
    """Draw the end points around the goal, in mm, with the circle of the promised limit if it is visible."""
    mark = goal()
    inset = panel.inset_axes((0.05, 0.36, 0.40, 0.52))
    inset.set_title("the mark, mm", fontsize=8)
    inset.set_aspect("equal")
    inset.tick_params(labelsize=7)
    inset.grid(alpha=0.3)
    reach = 1e3 * max(ZOOM, *(1.2 * outcome.end for _, outcome in outcomes))
    inset.set(xlim=(-reach, reach), ylim=(-reach, reach))
    inset.plot(0.0, 0.0, "+", color="black", markersize=12)
    inset.add_patch(Circle((0.0, 0.0), 10.0 * DISTANCE, fill=False, linestyle="--"))
    for trial, outcome in outcomes:
        x, y = outcome.path[-1]
        inset.plot(1e3 * (x - mark.x), 1e3 * (y - mark.y), "o", color=COLOURS[trial.battery], markersize=4)
    panel.indicate_inset((mark.x - 0.012, mark.y - 0.012, 0.024, 0.024), inset, edgecolor="black", alpha=0.6)


def _meant() -> list[tuple[float, float]]:
    pose, corners = Pose(), [(0.0, 0.0)]
    for leg, angle in zip(LEGS, (*TURNS, 0.0), strict=True):
        pose = pose.ahead(leg).turned(angle)
        corners.append((pose.x, pose.y))
    return corners
