"""The bumpers of a simulated robot: switches behind parts of the sides of its box-shaped outline."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from raccoon.core.readings import DIGITAL_PORTS
from raccoon.core.sections import BodyConfig, BumperConfig
from raccoon.sim.world.collision import Obstacles, Pose, Touch
from raccoon.sim.world.table import World

MIN_PRESS_COSINE = 0.5
"""Cosine of the largest angle between a push and the switch's inward direction at which the switch still
closes: 60 degrees."""
CLOSING_GAP = 1e-4
"""Distance from an obstacle at which a switch closes, m. So a switch of a robot that starts against a wall is
closed and does not depend on the last digit of the start pose."""
ALL_OPEN = (False,) * DIGITAL_PORTS
_INWARD = {"front": (-1.0, 0.0), "back": (1.0, 0.0), "left": (0.0, -1.0), "right": (0.0, 1.0)}


class _Switch(NamedTuple):
    """One switch: its digital port, the unit vector in which it gives way (robot's frame), and the part of
    its side behind which it lies, from low to high, m."""

    port: int
    inward_x: float
    inward_y: float
    low: float
    high: float

    def is_pressed(self, touches: Sequence[Touch]) -> bool:
        """Whether one obstacle, given all touches with it, presses the switch. A straight obstacle touches
        everything between two points of a flat side."""
        places = [
            each.x if self.inward_x == 0.0 else each.y
            for each in touches
            if each.normal_x * self.inward_x + each.normal_y * self.inward_y >= MIN_PRESS_COSINE
        ]
        return bool(places) and min(places) <= self.high and max(places) >= self.low


class Bumpers:
    """The switches of a robot with this outline, among the walls and objects of a table."""

    def __init__(self, bumpers: Iterable[BumperConfig], world: World, body: BodyConfig) -> None:
        self._switches = []
        for each in bumpers:
            low, high = each.part
            inward = _INWARD[each.side]
            self._switches.append(_Switch(each.digital, *inward, low - CLOSING_GAP, high + CLOSING_GAP))
        outline = replace(
            body,
            front=body.front + CLOSING_GAP,
            back=body.back + CLOSING_GAP,
            width=body.width + 2.0 * CLOSING_GAP,
        )
        self._obstacles = Obstacles(world, outline)

    def digital(self, pose: Pose) -> tuple[bool, ...]:
        """State of every digital port for a robot at this pose: True is pressed."""
        if not self._switches or self._obstacles.is_far(pose[0], pose[1]):
            return ALL_OPEN
        touched = self._obstacles.touches_by_obstacle(pose)
        pressed = {
            switch.port for switch in self._switches if any(switch.is_pressed(each) for each in touched)
        }
        return tuple([port in pressed for port in range(DIGITAL_PORTS)]) if pressed else ALL_OPEN
