"""A path on the floor: straight pieces with rounded corners, and heading and curvature at every point."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from raccoon.model.pose import Pose

Point = tuple[float, float]
MAX_CORNER_ANGLE = math.radians(170.0)
MIN_LEG_M = 1e-4
"""m; shorter pieces are dropped."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A line (curvature 0) or an arc: starting pose, length (m) and curvature (1/m, left positive)."""

    start: Pose
    length: float
    curvature: float

    def at(self, way: float) -> Pose:
        """The pose `way` m after its start."""
        if self.curvature == 0.0:
            return self.start.ahead(way)
        return self.start.along_arc(1.0 / self.curvature, way * self.curvature)


@dataclass(frozen=True, slots=True)
class PathState:
    """Pose on the path and its curvature there, 1/m."""

    pose: Pose
    curvature: float


class Path:
    """A path through `points` (m, at least two), each corner rounded by an arc of `rounding` m, or less if it
    does not fit.

    length: m. pieces: its lines and arcs. Raises ValueError for points that are not finite, too few of them,
    or a corner that turns back (more than 170 degrees).
    """

    def __init__(self, points: Sequence[Point], rounding: float = 0.1) -> None:
        if not 0.0 < rounding < math.inf:
            raise ValueError(f"rounding is {rounding} m: it must be above 0")
        for x, y in points:
            if not (math.isfinite(x) and math.isfinite(y)):
                raise ValueError(f"point ({x}, {y}): both numbers must be finite")
        kept = drop_repeated_points(points)
        if len(kept) < 2:
            raise ValueError(f"{len(kept)} different points: a path needs at least 2")
        self.pieces = _pieces(kept, rounding)
        self._begins = [0.0]
        for piece in self.pieces:
            self._begins.append(self._begins[-1] + piece.length)
        self.length = self._begins[-1]

    @property
    def start(self) -> Pose:
        """The pose at its start."""
        return self.pieces[0].start

    def at(self, way: float) -> PathState:
        """The state `way` m after the start; beyond either end, on the extended first or last piece."""
        index = self._index(way)
        piece = self.pieces[index]
        return PathState(piece.at(way - self._begins[index]), piece.curvature)

    def nearest(self, x: float, y: float, around: float, reach: float = 0.03) -> float:
        """Distance (m) along the path to its point nearest to (x, y), searched within `reach` m of
        `around`."""
        way = around
        for _ in range(3):  # the foot of the perpendicular; a circle needs a few steps
            ahead, _ = self.at(way).pose.offset_of(x, y)
            way = max(around - reach, min(around + reach, way + ahead))
        return way

    def _index(self, way: float) -> int:
        for index in range(len(self.pieces) - 1):
            if way < self._begins[index + 1]:
                return index
        return len(self.pieces) - 1


def drop_repeated_points(points: Sequence[Point]) -> list[Point]:
    """The points without those that coincide with the one before."""
    kept: list[Point] = []
    for point in points:
        if not kept or math.dist(kept[-1], point) > MIN_LEG_M:
            kept.append(point)
    return kept


def split_at_reversals(points: Sequence[Point]) -> list[list[Point]]:
    """The points, split where the path turns back: no arc rounds such a corner, so the robot stops there and
    turns."""
    kept = drop_repeated_points(points)
    found = [kept[:2]]
    for before, corner, after in zip(kept, kept[1:], kept[2:], strict=False):
        if abs(_corner_angle(_heading(before, corner), _heading(corner, after))) > MAX_CORNER_ANGLE:
            found.append([corner])
        found[-1].append(after)
    return found


def _heading(start: Point, end: Point) -> float:
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _corner_angle(before: float, after: float) -> float:
    return math.remainder(after - before, math.tau)


def _pieces(points: list[Point], rounding: float) -> list[Piece]:
    """Alternating lines and arcs."""
    headings = [_heading(a, b) for a, b in itertools.pairwise(points)]
    lengths = [math.dist(a, b) for a, b in itertools.pairwise(points)]
    pieces: list[Piece] = []
    here, taken = Pose(*points[0], headings[0]), 0.0
    for index, length in enumerate(lengths):
        bend = 0.0
        if index + 1 < len(lengths):
            bend = _corner_angle(headings[index], headings[index + 1])
        if abs(bend) > MAX_CORNER_ANGLE:
            corner = points[index + 1]
            raise ValueError(f"the path turns back at ({corner[0]:g}, {corner[1]:g}): drive it as two paths")
        cut = 0.0
        if bend:
            room = 0.5 * min(lengths[index], lengths[index + 1])
            cut = min(rounding * math.tan(0.5 * abs(bend)), room)
            if cut < MIN_LEG_M:  # too slight for an arc: nobody can drive or measure such a kink
                cut = 0.0
        if length - taken - cut > MIN_LEG_M or not pieces:
            pieces.append(Piece(here, length - taken - cut, 0.0))
            here = here.ahead(length - taken - cut)
        if not cut:
            here = Pose(*points[index + 1], here.heading + bend)  # headings stay unwrapped
        else:
            radius = cut / math.tan(0.5 * abs(bend))
            pieces.append(Piece(here, radius * abs(bend), math.copysign(1.0 / radius, bend)))
            here = here.along_arc(math.copysign(radius, bend), bend)
        taken = cut
    return pieces
