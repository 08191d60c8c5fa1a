"""The table a robot drives on: walls, black lines, a start box, objects, ramps and light.

Coordinates are in m, x ahead of the usual start pose and y to its left, so a robot that starts at (0, 0, 0)
stands in the start box.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from raccoon.core.errors import ConfigError

Point = tuple[float, float]


def _check_finite(what: str, *numbers: float) -> None:
    for number in numbers:
        if not math.isfinite(number):
            raise ConfigError(f"{what}: one of its numbers is {number}: allowed are finite numbers")


def _check_above_0(what: str, number: float) -> None:
    if not (math.isfinite(number) and number > 0.0):
        raise ConfigError(f"{what} is {number}: allowed are numbers above 0")


@dataclass(frozen=True, slots=True)
class Line:
    """A black line through two or more points, with its width, in m. Raises ConfigError for other points and
    widths."""

    points: tuple[Point, ...]
    width: float = 0.05

    def __post_init__(self) -> None:
        _check_finite("line", *(number for point in self.points for number in point))
        _check_above_0("line: width", self.width)
        if len(self.points) < 2 or any(a == b for a, b in pairwise(self.points)):
            raise ConfigError(f"line: points are {self.points}: allowed are two or more, none twice in a row")


@dataclass(frozen=True, slots=True)
class Wall:
    """A straight wall without thickness. Raises ConfigError if its ends coincide."""

    start: Point
    end: Point

    def __post_init__(self) -> None:
        _check_finite("wall", *self.start, *self.end)
        if self.start == self.end:
            raise ConfigError(f"wall: both ends are {self.start}: they must differ")


@dataclass(frozen=True, slots=True)
class Thing:
    """A rigid, fixed object: a disc with centre and radius in m."""

    centre: Point
    radius: float

    def __post_init__(self) -> None:
        _check_finite("object", *self.centre)
        _check_above_0("object: radius", self.radius)


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle parallel to the axes, with the corners low and high, in m. Raises ConfigError unless low is
    below high."""

    low: Point
    high: Point

    def __post_init__(self) -> None:
        if not (self.low[0] < self.high[0] and self.low[1] < self.high[1]):
            raise ConfigError(f"box: low {self.low} must be below high {self.high} in both x and y")

    def holds(self, x: float, y: float) -> bool:
        """Whether the point (x, y), m, lies inside or on the edge."""
        return self.low[0] <= x <= self.high[0] and self.low[1] <= y <= self.high[1]

    def share(self, x: float, y: float, along_x: float, along_y: float) -> float:
        """Share, 0..1, of the straight way from (x, y) by (along_x, along_y), m, that lies inside."""
        begin, end = 0.0, 1.0
        for at, way, low, high in zip((x, y), (along_x, along_y), self.low, self.high, strict=True):
            if way != 0.0:
                sides = (low - at) / way, (high - at) / way
                begin, end = max(begin, min(sides)), min(end, max(sides))
            elif not low <= at <= high:
                return 0.0
        return max(0.0, end - begin)


@dataclass(frozen=True, slots=True)
class Light:
    """A region with additional light. ambient: level, 0 indoors, 1 direct sun, at most 2. begin, end: times
    at which the light goes on and off, s."""

    region: Box
    ambient: float
    begin: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        if not 0.0 <= self.ambient <= 2.0:
            raise ConfigError(
                f"light: ambient is {self.ambient}: allowed are numbers from 0 (normal) to 2 (1: sun)"
            )


@dataclass(frozen=True, slots=True)
class Ramp:
    """A sloping region. along_x, along_y: torque at each wheel that pulls along +x and +y, N m."""

    region: Box
    along_x: float = 0.0
    along_y: float = 0.0

    def __post_init__(self) -> None:
        _check_finite("ramp", self.along_x, self.along_y)


@dataclass(frozen=True, slots=True)
class World:
    """A table with everything on it. `area` is its surface, None if it has no edge."""

    name: str = "empty"
    area: Box | None = None
    start_box: Box | None = None
    lines: tuple[Line, ...] = ()
    walls: tuple[Wall, ...] = ()
    objects: tuple[Thing, ...] = ()
    lights: tuple[Light, ...] = ()
    ramps: tuple[Ramp, ...] = ()
    _strips: tuple[tuple[float, ...], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        strips = [
            (*start, end[0] - start[0], end[1] - start[1], line.width / 2)
            for line in self.lines
            for start, end in zip(line.points, line.points[1:], strict=False)
        ]
        object.__setattr__(self, "_strips", tuple(strips))

    @classmethod
    def empty(cls) -> World:
        """A white table without edge, lines or obstacles."""
        return cls()

    @classmethod
    def default(cls) -> World:
        """A table of Botball size with walls, lines and a start box."""
        low, high = (-0.3, -0.6), (2.06, 0.57)
        lines = (
            Line(((0.9, -0.6), (0.9, 0.57))),
            Line(((1.6, -0.6), (1.6, 0.57))),
            Line(((0.9, 0.0), (1.6, 0.0))),
        )
        return cls("botball", Box(low, high), Box(low, (0.3, 0.3)), lines, walls_around(Box(low, high)))

    @classmethod
    def from_file(cls, path: str | Path) -> World:
        """Read a table file (`sim.world.table_file`). Raises ConfigError, FileNotFoundError."""
        from raccoon.sim.world.table_file import load_world

        return load_world(path)

    def nearest_line(self, x: float, y: float) -> tuple[float, float]:
        """Distance from a point to the nearest edge of a black line, negative inside the line, and the width
        of this line, m. Both are infinite on a table without lines."""
        nearest, width = math.inf, math.inf
        for start_x, start_y, along_x, along_y, half in self._strips:
            dx, dy = x - start_x, y - start_y
            length = along_x * along_x + along_y * along_y
            share = (dx * along_x + dy * along_y) / length
            share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
            dx -= share * along_x
            dy -= share * along_y
            distance = math.sqrt(dx * dx + dy * dy) - half
            if distance < nearest:
                nearest, width = distance, 2.0 * half
        return nearest, width

    def ambient(self, x: float, y: float, time: float) -> float:
        """Level of light at a point (m) and time (s): 0 indoors, 1 direct sun."""
        if not self.lights:
            return 0.0
        shining = [
            each.ambient for each in self.lights if each.begin <= time < each.end and each.region.holds(x, y)
        ]
        return max(shining, default=0.0)

    def slope(self, x: float, y: float) -> Point:
        """Slope at a point: torque at each wheel along x and along y, N m."""
        there = [each for each in self.ramps if each.region.holds(x, y)]
        return sum(each.along_x for each in there), sum(each.along_y for each in there)

    def slope_along(self, x: float, y: float, along_x: float, along_y: float) -> Point:
        """Mean slope, as of `slope`, over the straight way from (x, y) by (along_x, along_y), m."""
        mean_x = mean_y = 0.0
        for ramp in self.ramps:
            share = ramp.region.share(x, y, along_x, along_y)
            mean_x += share * ramp.along_x
            mean_y += share * ramp.along_y
        return mean_x, mean_y


def walls_around(box: Box) -> tuple[Wall, ...]:
    """The four walls around a box."""
    (left, low), (right, high) = box.low, box.high
    corners = ((left, low), (right, low), (right, high), (left, high))
    return tuple(Wall(start, end) for start, end in zip(corners, (*corners[1:], corners[0]), strict=True))
