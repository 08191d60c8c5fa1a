"""The points at which a robot, a rectangle, overlaps the walls and objects of its table."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from raccoon.core.errors import ConfigError
from raccoon.core.sections import BodyConfig
from raccoon.sim.world.table import Point, World

MIN_SAME_TOUCH_COSINE = 0.7
"""Cosine of the largest angle (about 45 degrees) between the push of a touch and the shortest separation of
robot and wall, at which the touch counts."""
Segment = tuple[float, float, float, float]
Pose = tuple[float, float, float]
"""x, y in m and heading in rad, in the world."""


TOUCH_TOLERANCE = 1e-3
"""Depth of overlap, m, that is accepted at a start pose: a robot placed against a wall may overlap it by
rounding."""


class Touch(NamedTuple):
    """A point at which the robot overlaps an obstacle, in the robot's frame.

    x (forward), y (left): m. normal_x, normal_y: unit vector of the direction in which the robot is pushed.
    depth: of the overlap, m.
    """

    x: float
    y: float
    normal_x: float
    normal_y: float
    depth: float


class Obstacles:
    """The walls and objects of a table, for a robot with this outline. Remembers its clearance to the nearest
    obstacle: until the robot has driven that far, no obstacle is examined again."""

    def __init__(self, world: World, body: BodyConfig) -> None:
        self._front, self._back, self._side = body.front, -body.back, 0.5 * body.width
        self._corners = tuple((x, y) for x in (self._front, self._back) for y in (self._side, -self._side))
        self._reach = max(math.hypot(*corner) for corner in self._corners)
        self._walls = [(*wall.start, *wall.end) for wall in world.walls]
        self._objects = [(*thing.centre, thing.radius) for thing in world.objects]
        self._x = self._y = 0.0
        self._clearance = -1.0 if self._walls or self._objects else math.inf

    def is_far(self, x: float, y: float) -> bool:
        """Whether, by the clearance found last, a robot centred at (x, y), m, certainly touches nothing."""
        return math.hypot(x - self._x, y - self._y) < self._clearance

    def touches(self, pose: Pose) -> list[Touch]:
        """All touches of a robot at this pose."""
        return [touch for touches in self.touches_by_obstacle(pose) for touch in touches]

    def touches_by_obstacle(self, pose: Pose) -> list[list[Touch]]:
        """All touches of a robot at this pose, one list per wall or object near it (empty if they do not
        overlap)."""
        x, y, heading = pose
        if self.is_far(x, y):
            return []
        cosine, sine = math.cos(heading), math.sin(heading)
        found: list[list[Touch]] = []
        nearest = math.inf
        for wall in self._walls:
            gap = _distance(wall, x, y) - self._reach
            nearest = min(nearest, gap)
            if gap < 0.0:
                start = _seen(wall[0] - x, wall[1] - y, cosine, sine)
                end = _seen(wall[2] - x, wall[3] - y, cosine, sine)
                found.append(list(self._against_wall(start, end)))
        for centre_x, centre_y, radius in self._objects:
            gap = math.hypot(centre_x - x, centre_y - y) - radius - self._reach
            nearest = min(nearest, gap)
            if gap < 0.0:
                centre = _seen(centre_x - x, centre_y - y, cosine, sine)
                found.append(list(self._against_disc(centre, radius)))
        self._x, self._y, self._clearance = x, y, nearest
        return found

    def _against_wall(self, start: Point, end: Point) -> Iterator[Touch]:
        """Touches with a wall: corners of the robot that are through it, and ends of the wall that are inside
        the robot.

        Which of them count is decided by the shortest separation of robot and wall, along the wall's normal
        or one of the robot's axes: if a robot meets the end of a wall with its side, it has corners on both
        sides of that wall's line, although they do not touch the wall.
        """
        length = math.dist(start, end)
        along_x, along_y = (end[0] - start[0]) / length, (end[1] - start[1]) / length
        normal_x, normal_y = -along_y, along_x
        away = -(normal_x * start[0] + normal_y * start[1])
        if away < 0.0:  # the normal has to point towards the robot's centre
            normal_x, normal_y, away = -normal_x, -normal_y, -away
        corners = []
        for x, y in self._corners:
            depth = -away - normal_x * x - normal_y * y
            place = along_x * (x - start[0]) + along_y * (y - start[1])
            corners.append((depth, Touch(x, y, normal_x, normal_y, depth), 0.0 <= place <= length))
        ways = [
            (max(depth for depth, _, _ in corners), normal_x, normal_y),
            (self._front - min(start[0], end[0]), -1.0, 0.0),
            (max(start[0], end[0]) - self._back, 1.0, 0.0),
            (self._side - min(start[1], end[1]), 0.0, -1.0),
            (max(start[1], end[1]) + self._side, 0.0, 1.0),
        ]
        shortest, out_x, out_y = min(ways, key=lambda way: way[0])
        if shortest <= 0.0:
            return
        if normal_x * out_x + normal_y * out_y > MIN_SAME_TOUCH_COSINE:
            yield from (touch for depth, touch, beside in corners if depth > 0.0 and beside)
        for point in (start, end):
            depth, push_x, push_y = self._way_out(point)
            if depth > 0.0 and push_x * out_x + push_y * out_y > MIN_SAME_TOUCH_COSINE:
                yield Touch(*point, push_x, push_y, depth)

    def _against_disc(self, centre: Point, radius: float) -> Iterator[Touch]:
        x = min(max(centre[0], self._back), self._front)
        y = min(max(centre[1], -self._side), self._side)
        distance = math.hypot(x - centre[0], y - centre[1])
        if distance == 0.0:  # its centre is under the robot
            depth, push_x, push_y = self._way_out(centre)
            yield Touch(x, y, push_x, push_y, depth + radius)
        elif distance < radius:
            yield Touch(x, y, (x - centre[0]) / distance, (y - centre[1]) / distance, radius - distance)

    def _way_out(self, point: Point) -> tuple[float, float, float]:
        """Depth of a point inside the robot, m (negative: outside), and the direction (unit vector) in which
        the robot leaves the point over the shortest distance."""
        x, y = point
        return min(
            (self._front - x, -1.0, 0.0),
            (x - self._back, 1.0, 0.0),
            (self._side - y, 0.0, -1.0),
            (y + self._side, 0.0, 1.0),
        )


def _seen(dx: float, dy: float, cosine: float, sine: float) -> Point:
    """The displacement (dx, dy) from the robot's centre, turned from the world's frame to the robot's.
    cosine, sine: of its heading."""
    return cosine * dx + sine * dy, cosine * dy - sine * dx


def _distance(wall: Segment, x: float, y: float) -> float:
    """Distance from the point (x, y) to a wall, m."""
    along_x, along_y = wall[2] - wall[0], wall[3] - wall[1]
    share = ((x - wall[0]) * along_x + (y - wall[1]) * along_y) / (along_x**2 + along_y**2)
    share = min(max(share, 0.0), 1.0)
    return math.hypot(x - wall[0] - share * along_x, y - wall[1] - share * along_y)


def check_standing(start: Pose, table: World, body: BodyConfig) -> None:
    """Check a start pose. Raises ConfigError if it is not finite, off the table, or overlaps an obstacle by
    more than TOUCH_TOLERANCE."""
    x, y, heading = start
    if not all(map(math.isfinite, start)):
        raise ConfigError(f"start is {start}: allowed are finite numbers")
    told = f"start is x {x:g} m, y {y:g} m, {math.degrees(heading):g} deg"
    if table.area is not None and not table.area.holds(x, y):
        (left, low), (right, high) = table.area.low, table.area.high
        ends = f"x from {left:g} to {right:g} m and y from {low:g} to {high:g} m"
        raise ConfigError(f"{told}: it is off the table {table.name}, which has {ends}")
    deepest = max((each.depth for each in Obstacles(table, body).touches(start)), default=0.0)
    if deepest > TOUCH_TOLERANCE:
        raise ConfigError(
            f"{told}: a robot of this size ([body] in robot.toml) stands {deepest:.2g} m deep in a wall or "
            f"an object of the table {table.name}"
        )
