"""Drawing of a table and a drive over it with matplotlib."""

from __future__ import annotations

from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from raccoon.cli.outputs import save_figure
from raccoon.cli.view.drive import Drive, Trajectory
from raccoon.core.config import BodyConfig
from raccoon.core.files import write_atomically
from raccoon.sim.world.table import Box, Line, World

FRAMES_A_SECOND = 10
MAX_FRAMES = 600
ANIMATION_DPI = 72
MARGIN = 0.1  # m
TRUTH, BELIEF = "#1f4e9c", "#c0392b"


def write_picture(drive: Drive, world: World, path: Path) -> None:
    """Draw the whole drive and write it to an SVG or PNG file, by the file's ending."""
    figure, axes = _table(world, drive)
    for which, trail in _trails(axes, drive):
        trail.set_data(which.x, which.y)
    _robot(axes, drive, 0, filled=False)
    _robot(axes, drive, -1, filled=True)
    _save(figure, path)


def _trails(axes: Any, drive: Drive) -> list[tuple[Trajectory, Any]]:
    """The drive's trajectories, true and estimated, each with an empty line that is to show it."""
    kinds = ((drive.truth, TRUTH, "-", "truth"), (drive.estimate, BELIEF, "--", "as the robot believes"))
    trails = [
        (which, axes.plot([], [], style, color=colour, linewidth=1.2, label=label)[0])
        for which, colour, style, label in kinds
        if which is not None
    ]
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False, fontsize=7)
    return trails


def write_animation(drive: Drive, world: World, path: Path, speed: float) -> int:
    """Draw the drive as an animated GIF at `speed` times real time. Returns the number of frames."""
    from PIL import Image

    figure, axes = _table(world, drive)
    best = drive.best
    count = min(max(int(drive.seconds / speed * FRAMES_A_SECOND), 2), MAX_FRAMES)
    moments = np.linspace(best.time[0], best.time[-1], count)
    rows = np.searchsorted(best.time, moments).clip(0, len(best.time) - 1)
    trails = _trails(axes, drive)
    body, nose = _robot(axes, drive, 0, filled=True)
    clock = axes.set_title("", fontsize=8, loc="right")

    def draw(frame: int) -> Any:
        row = int(rows[frame])
        for which, trail in trails:
            until = int(np.searchsorted(which.time, moments[frame], side="right"))
            trail.set_data(which.x[:until], which.y[:until])
        outline, line = _outline(best, row, drive.body)
        body.set_xy(outline)
        nose.set_data(*line)
        clock.set_text(f"{best.time[row] - best.time[0]:.1f} s")
        figure.canvas.draw()
        return Image.fromarray(np.asarray(figure.canvas.buffer_rgba())).convert("RGB").quantize()

    figure.set_dpi(ANIMATION_DPI)
    # Not with matplotlib's writer, which turns a Ctrl-C before its first frame into another error.
    first, *others = [draw(frame) for frame in range(count)]
    buffer = BytesIO()
    # ms, in whole hundredths of a second as a GIF counts; longer if the number of frames is limited.
    duration = 10 * max(2, round(100 * drive.seconds / speed / count))
    first.save(buffer, format="gif", save_all=True, append_images=others, duration=duration, loop=0)
    write_atomically(path, buffer.getvalue())
    return count


def _table(world: World, drive: Drive) -> tuple[Any, Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set_aspect("equal")
    low, high = _extent(world, drive)
    axes.set_xlim(low[0] - MARGIN, high[0] + MARGIN)
    axes.set_ylim(low[1] - MARGIN, high[1] + MARGIN)
    axes.set_xlabel("x, m", fontsize=8)
    axes.set_ylabel("y, m", fontsize=8)
    axes.tick_params(labelsize=7)
    _draw_table_parts(axes, world)
    return figure, axes


def _draw_table_parts(axes: Any, world: World) -> None:
    from matplotlib.patches import Circle

    for light in world.lights:
        axes.add_patch(
            _rectangle(axes, light.region, color="#f9e79f", alpha=0.5 * min(light.ambient, 1.0) + 0.2)
        )
    for ramp in world.ramps:
        axes.add_patch(_rectangle(axes, ramp.region, color="0.85", hatch="//", fill=False, linewidth=0.0))
    if world.start_box is not None:
        axes.add_patch(_rectangle(axes, world.start_box, fill=False, edgecolor="0.5", linestyle=":"))
    table = None if world.area is None else _rectangle(axes, world.area, transform=axes.transData)
    for line in world.lines:
        axes.add_patch(_line_patch(line)).set_clip_path(table)  # cut off the round ends beyond the table
    for wall in world.walls:
        axes.plot(
            *zip(wall.start, wall.end, strict=True), color="#8d6e63", linewidth=3.0, solid_capstyle="round"
        )
    for thing in world.objects:
        axes.add_patch(Circle(thing.centre, thing.radius, color="#2e7d32"))


def _line_patch(line: Line) -> Any:
    """A patch of a line as the simulated tophats see it: everything within half a width of the polyline."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    parts, half = [], 0.5 * line.width
    for start, end in pairwise(np.array(line.points)):
        along = (end - start) / np.hypot(*(end - start))
        across = half * np.array([-along[1], along[0]])
        corners = (start + across, start - across, end - across, end + across)
        parts.append(Outline([*corners, corners[0]], closed=True))
    parts += [Outline.circle(point, half) for point in line.points]
    return PathPatch(Outline.make_compound_path(*parts), color="black", linewidth=0.0)


def _rectangle(axes: Any, box: Box, **style: Any) -> Any:
    """The visible part of a box as a patch: light and ramps may extend without limit."""
    from matplotlib.patches import Rectangle

    (left, right), (low, high) = (
        np.clip(ends, *limits).tolist()
        for ends, limits in zip(
            zip(box.low, box.high, strict=True), (axes.get_xlim(), axes.get_ylim()), strict=True
        )
    )
    return Rectangle((left, low), right - left, high - low, **style)


def _robot(axes: Any, drive: Drive, row: int, *, filled: bool) -> tuple[Any, Any]:
    from matplotlib.patches import Polygon

    outline, line = _outline(drive.best, row, drive.body)
    body = Polygon(outline, closed=True, fill=filled, color=TRUTH, alpha=0.35)
    axes.add_patch(body)
    (nose,) = axes.plot(*line, color=TRUTH, linewidth=2.0)
    return body, nose


def _outline(path: Trajectory, row: int, body: BodyConfig) -> tuple[Any, Any]:
    """Corners of the robot's outline, (4, 2), and x and y of a line from its centre to its front, m."""
    heading = path.heading[row]
    ahead, aside = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    middle, side = np.array([path.x[row], path.y[row]]), 0.5 * body.width
    ends = ((body.front, side), (-body.back, side), (-body.back, -side), (body.front, -side))
    corners = np.array([middle + along * ahead + across * aside for along, across in ends])
    return corners, np.stack([middle, middle + body.front * ahead], axis=1)


def _extent(world: World, drive: Drive) -> tuple[tuple[float, float], tuple[float, float]]:
    paths = [each for each in (drive.truth, drive.estimate) if each is not None]
    xs = np.concatenate([each.x for each in paths])
    ys = np.concatenate([each.y for each in paths])
    reach = float(np.hypot(max(drive.body.front, drive.body.back), 0.5 * drive.body.width))  # to a corner
    low = float(xs.min()) - reach, float(ys.min()) - reach
    high = float(xs.max()) + reach, float(ys.max()) + reach
    if world.area is None:
        return low, high
    area = world.area
    return (
        (min(low[0], area.low[0]), min(low[1], area.low[1])),
        (max(high[0], area.high[0]), max(high[1], area.high[1])),
    )


def _save(figure: Any, path: Path) -> None:
    from matplotlib import rc_context

    metadata = {"Date": None} if path.suffix == ".svg" else {"Software": None}
    with rc_context({"svg.hashsalt": "raccoon"}):
        save_figure(figure, path, dpi=110, metadata=metadata)
