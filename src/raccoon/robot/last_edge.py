"""What a robot that follows a line knows of it: where its edge was last, and whether it is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

SHORT_EDGE = 0.03
"""m of an edge below which the sensor only went across it."""
STEADY, ALIKE, HALF, MOST_OFF = 0.05, 0.04, 0.02, 0.4
"""m of the way, and shares of the sensor's spot: what differs by less is alike, and half, and what is further
off from half is as good as a surface."""


class LastEdge:
    """Where the sensor was on an edge of the line the last time.

    place: m of the way. time: s. heading: rad of the line, as far as known. pointing: rad of the robot there,
    None before the first edge. to_black: whether it came from the edge to black first (then the line turned
    to that side, or another one crosses it), None while it keeps to one. doubtful: whether it reads the
    same for a while, and not half an edge: one in a bend does, and so does the floor in other light.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.heading = robot.estimate.heading
        self.pointing: float | None = None
        self.to_black: bool | None = None
        self._level, self._since, self._believed = 0.5, 0.0, False
        self._straight = self.heading  # when it last read half an edge, as where the line goes straight on
        self.begin()

    def begin(self) -> None:
        """Count as an edge the place where the robot is."""
        self.place = self._met = self._robot.estimate.distance
        self.time = self._robot.time
        self._on = True

    @property
    def kept(self) -> bool:
        """Whether the sensor did not only go across the edge."""
        return self.place - self._met > SHORT_EDGE

    @property
    def doubtful(self) -> bool:
        """See the class."""
        steady = self.place - self._since > STEADY
        return steady and not self._believed and HALF < abs(self._level - 0.5) < MOST_OFF

    def believe(self, edge: bool) -> None:
        """It was found out whether it is an edge; where it is none, the line goes as it did before."""
        self._believed = True
        if not edge:
            self.heading = self._straight

    def see(self, coverage: float) -> bool:
        """Take the sensor's coverage of this cycle; whether it is on an edge."""
        here, on = self._robot.estimate, 0.02 < coverage < 0.98
        if abs(coverage - self._level) > ALIKE:
            self._level, self._since, self._believed = coverage, here.distance, False
        if abs(coverage - 0.5) < HALF:
            self._straight = here.heading
        if on:
            if not self._on:
                self._met = here.distance
            self.place, self.pointing, self.time = here.distance, here.heading, self._robot.time
            if self.kept:
                self.to_black = None
        elif self.to_black is None:
            self.to_black = coverage > 0.5
        self._on = on
        return on
