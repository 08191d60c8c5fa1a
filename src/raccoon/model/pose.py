"""Poses on the floor, and the check of a heading's unit."""

from __future__ import annotations

import math
from dataclasses import dataclass


def looks_like_degrees(angle: float) -> bool:
    """Whether an angle is probably in degrees: a multiple of 0.5, which is unlikely for a value in rad."""
    return angle % 0.5 == 0.0


def check_heading_unit(name: str, heading: float) -> None:
    """Raise ValueError for a heading in rad that is probably in degrees.

    A heading counts full turns, so it may be beyond one, but then it is not a multiple of 0.5 rad.
    """
    if abs(heading) > math.tau and looks_like_degrees(heading):
        raise ValueError(
            f"{name} is {heading:g}: beyond a full turn no heading in rad is so round "
            f"(write deg({heading:g}) for degrees)"
        )


@dataclass(frozen=True, slots=True)
class Pose:
    """x, y in m, heading in rad (unwrapped, counter-clockwise positive)."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def __str__(self) -> str:
        """The pose as text, to a millimetre and a tenth of a degree."""
        return f"x {self.x:z.3f} m, y {self.y:z.3f} m, heading {math.degrees(self.heading):z.1f} deg"

    def ahead(self, distance: float) -> Pose:
        """The pose `distance` m further along this heading."""
        return Pose(
            self.x + distance * math.cos(self.heading),
            self.y + distance * math.sin(self.heading),
            self.heading,
        )

    def turned(self, angle: float) -> Pose:
        """The pose after turning on the spot by `angle` rad."""
        return Pose(self.x, self.y, self.heading + angle)

    def along_arc(self, radius: float, angle: float) -> Pose:
        """The pose after an arc through `angle` rad; `radius` m is positive with the centre on the left."""
        centre_x = self.x - radius * math.sin(self.heading)
        centre_y = self.y + radius * math.cos(self.heading)
        heading = self.heading + angle
        return Pose(centre_x + radius * math.sin(heading), centre_y - radius * math.cos(heading), heading)

    def offset_of(self, x: float, y: float) -> tuple[float, float]:
        """The point (x, y), m, in this pose's frame: m ahead, m to the left."""
        dx, dy = x - self.x, y - self.y
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return dx * cos + dy * sin, dy * cos - dx * sin
