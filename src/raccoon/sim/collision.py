"""Walls and objects: a round robot is pushed out of them and slides along."""

from __future__ import annotations

import math

from raccoon.sim.world import World

BODY_RADIUS = 0.09
"""m, of a usual robot."""


class Obstacles:
    """What stands on a table, for a round robot. Remembers how far it is from everything, so that it need
    not look again before it has driven that far.

    radius: m, of the robot.
    """

    def __init__(self, world: World, radius: float) -> None:
        self._radius = radius
        self._walls = [
            (*wall.start, wall.end[0] - wall.start[0], wall.end[1] - wall.start[1]) for wall in world.walls
        ]
        self._objects = [(*thing.centre, radius + thing.radius) for thing in world.objects]
        self._x = self._y = 0.0
        self._clearance = -1.0 if self._walls or self._objects else math.inf

    def pushed_out(self, x: float, y: float) -> tuple[float, float]:
        """Where the robot's middle ends that wants to be at (x, y).

        It is moved away from each wall or object it would overlap, square to it, which leaves the motion
        along it. Two rounds, so that a corner holds it from both sides.
        """
        if math.hypot(x - self._x, y - self._y) < self._clearance:
            return x, y
        first_x, first_y = x, y
        for _ in range(2):
            nearest = math.inf
            for start_x, start_y, along_x, along_y in self._walls:
                share = ((x - start_x) * along_x + (y - start_y) * along_y) / (along_x**2 + along_y**2)
                share = min(max(share, 0.0), 1.0)
                point_x, point_y = start_x + share * along_x, start_y + share * along_y
                x, y, gap = _away(point_x, point_y, x, y, self._radius)
                nearest = min(nearest, gap)
            for point_x, point_y, radius in self._objects:
                x, y, gap = _away(point_x, point_y, x, y, radius)
                nearest = min(nearest, gap)
            if (x, y) == (first_x, first_y):
                break
        self._x, self._y, self._clearance = x, y, nearest
        return x, y


def _away(point_x: float, point_y: float, x: float, y: float, radius: float) -> tuple[float, float, float]:
    """(x, y) moved to `radius` from a point where it is nearer, and the gap that was left."""
    dx, dy = x - point_x, y - point_y
    distance = math.hypot(dx, dy)
    if distance >= radius or distance == 0.0:
        return x, y, distance - radius
    return point_x + dx * radius / distance, point_y + dy * radius / distance, 0.0
