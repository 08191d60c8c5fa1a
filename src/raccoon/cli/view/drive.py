"""A recorded drive to draw: the true and the estimated trajectory, and the recorded messages."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raccoon.cli.progress import show_progress
from raccoon.core.config import BodyConfig
from raccoon.core.errors import TraceError
from raccoon.sim.world.table import Wall
from raccoon.trace.loading import Run, load_run
from raccoon.trace.problems import without_repeats

Floats = NDArray[np.float64]
WALL_TOLERANCE_M = 0.01
"""Depth, m, by which a robot that pushes against a wall may seem to overlap it."""
TRUTH = ("truth.x", "truth.y", "truth.heading")
ESTIMATE = ("estimate.drive.0", "estimate.drive.1", "estimate.drive.2")
"""Columns of the first three numbers of the robot's drive estimate, the pose; only these are drawn."""


@dataclass(frozen=True)
class Trajectory:
    """Poses over time: time in s, x and y in m, heading in rad."""

    time: Floats
    x: Floats
    y: Floats
    heading: Floats

    def pose(self, row: int) -> tuple[float, float, float]:
        """x, y (m) and heading (rad) of a row."""
        return float(self.x[row]), float(self.y[row]), float(self.heading[row])

    def row_at(self, time: float) -> int:
        """The first row at or after a time, s; the last row if there is none."""
        return min(int(np.searchsorted(self.time, time)), len(self.time) - 1)

    def moved_to(self, x: float, y: float, heading: float) -> Trajectory:
        """The path, relative to the origin, moved to another start pose (m, m, rad)."""
        cosine, sine = math.cos(heading), math.sin(heading)
        return Trajectory(
            self.time,
            x + cosine * self.x - sine * self.y,
            y + sine * self.x + cosine * self.y,
            self.heading + heading,
        )


@dataclass(frozen=True)
class Drive:
    """A drive to draw. truth or estimate may be None, but not both.

    body: the robot's outline, the default one if the recording does not contain it. said: recorded messages,
    each with its time, s. problems: what is damaged in the recording or could not be read.
    """

    truth: Trajectory | None
    estimate: Trajectory | None
    body: BodyConfig
    said: tuple[tuple[float, str], ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def best(self) -> Trajectory:
        """The true trajectory if it is known, otherwise the estimate."""
        path = self.truth or self.estimate
        assert path is not None
        return path

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return float(self.best.time[-1] - self.best.time[0])

    @property
    def length(self) -> float:
        """Length of the path, m."""
        return float(np.sum(np.hypot(np.diff(self.best.x), np.diff(self.best.y))))


def load_drive(path: Path, start: Sequence[float] | None = None) -> Drive:
    """Load the drive in a recording.

    start: x, y (m) and heading (deg) on the table, to which both paths are moved; by default the truth stays
    where it is and the estimate begins on it. Raises TraceError if the recording is empty or has neither.
    """
    with show_progress():
        run = load_run(path)
    truth, estimate = _truth(run), _estimate(run)
    placed = None if start is None else (start[0], start[1], math.radians(start[2]))
    if len(run.recording) == 0:
        raise TraceError(f"{path}: the recording is empty: it was ended before its first cycle")
    if truth is None and estimate is None:
        raise TraceError(
            f"{path}: it has neither truth.x, truth.y, truth.heading nor estimates to draw; "
            "raccoon replay RECORDING --plot drive.svg draws what the odometry makes of it"
        )
    if truth is not None and placed is not None:
        truth = _relative_to_pose(truth).moved_to(*placed)
    if truth is not None and estimate is not None:
        # Either may begin later than the other: they are made to meet at the first time that both cover.
        first = max(truth.time[0], estimate.time[0])
        estimate = _relative_to_pose(estimate, estimate.row_at(first)).moved_to(
            *truth.pose(truth.row_at(first))
        )
    elif estimate is not None and placed is not None:
        estimate = _relative_to_pose(estimate).moved_to(*placed)
    time = run.recording["t"]
    said = tuple((float(time[event.tick]), event.text) for event in run.recording.events)
    body = BodyConfig() if run.robot is None else run.robot.body
    return Drive(truth, estimate, body, said, tuple(without_repeats(run.recording.problems)))


def goes_through_wall(path: Trajectory, body: BodyConfig, walls: Iterable[Wall]) -> bool:
    """Whether the path crosses a wall, or the robot stands on both sides of one: then there was no such
    wall."""
    front, back, side = (
        body.front - WALL_TOLERANCE_M,
        -body.back + WALL_TOLERANCE_M,
        0.5 * body.width - WALL_TOLERANCE_M,
    )
    middle = np.stack([path.x, path.y], axis=1)
    ahead = np.stack([np.cos(path.heading), np.sin(path.heading)], axis=1)
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    ways = [(middle[:-1], middle[1:])]
    ways += [(middle, middle + x * ahead + y * left) for x in (front, back) for y in (side, -side)]
    return any(_crosses_wall(start, end, wall) for start, end in ways for wall in walls)


def _crosses_wall(start: Floats, end: Floats, wall: Wall) -> bool:
    """Whether a wall intersects one of the segments from `start` to `end`, (n, 2) each."""
    foot = np.array(wall.start)
    along = np.array(wall.end) - foot
    beside = _cross_products(along, start - foot) * _cross_products(along, end - foot)
    around = _cross_products(end - start, foot - start) * _cross_products(end - start, foot + along - start)
    return bool(((beside < 0.0) & (around < 0.0)).any())


def _cross_products(first: Floats, second: Floats) -> Floats:
    """Cross products of 2-D vectors, positive where the second one points to the left of the first."""
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def _truth(run: Run) -> Trajectory | None:
    return _path(run, TRUTH) if run.recording.has_truth else None


def _estimate(run: Run) -> Trajectory | None:
    """The poses that the robot estimated, in any format of the recording."""
    return _path(run, ESTIMATE) if all(name in run.recording for name in ESTIMATE) else None


def _path(run: Run, pose: tuple[str, str, str]) -> Trajectory | None:
    """The poses in these columns; None if fewer than two are complete."""
    columns = [run.recording[name] for name in ("t", *pose)]
    known = ~np.isnan(np.stack(columns)).any(axis=0)
    return Trajectory(*(column[known] for column in columns)) if known.sum() > 1 else None


def _relative_to_pose(path: Trajectory, row: int = 0) -> Trajectory:
    """The path relative to its pose at a row."""
    x, y, heading = path.pose(row)
    moved = Trajectory(path.time, path.x - x, path.y - y, path.heading)
    return moved.moved_to(0.0, 0.0, -heading)
