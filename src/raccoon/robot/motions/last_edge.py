"""What a robot that follows a line knows of it: where its edge was last, and whether it is one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

SHORT_EDGE = 0.03
"""m of an edge below which the sensor only went across it."""
STEADY, ALIKE, HALF, MOST_OFF = 0.05, 0.04, 0.02, 0.4
"""m of the way, and shares of the sensor's spot: what differs by less is alike, and half, and what is further
off from half is as good as a surface."""
LOST_TIME, LOST_WAY, NONE_YET_TIME = 1.0, 0.15, 0.5
"""s and m without an edge under the sensor after which the line is lost; s where there was none yet."""
SEARCH_APART = 0.05
"""m of the way that one search for the line is from the next, or both are for the same place."""


class LastEdge:
    """Where the sensor was on an edge of the line the last time.

    place: m of the way. time: s. heading: rad of the line, as far as known. pointing: rad of the robot there,
    None before the first edge. to_black: whether it came from the edge to black first (then the line turned
    to that side, or another one crosses it), None while it keeps to one. doubtful: whether it reads the
    same for a while, and not half an edge: one in a bend does, and so does the floor in other light. other:
    the tophat that was on an edge at the start, where the one that follows was on none.
    """

    def __init__(self, robot: Robot, other: str = "") -> None:
        self._robot, self.other = robot, other
        self.heading = robot.estimate.heading
        self.pointing: float | None = None
        self.to_black: bool | None = None
        self._level, self._since, self._believed = 0.5, 0.0, False
        self._straight = self.heading  # when it last read half an edge, as where the line goes straight on
        self._patience, self._searched, self._searches = NONE_YET_TIME, -math.inf, 0
        self._begin()

    def _begin(self) -> None:
        """Count as an edge the place where the robot is."""
        self.place = self._met = self._robot.estimate.distance
        self.time = self._robot.time
        self._on = True

    @property
    def lost(self) -> bool:
        """Whether there was no edge for too long, or on too long a way."""
        here = self._robot
        return here.time - self.time > self._patience or here.estimate.distance - self.place > LOST_WAY

    def searches(self) -> int:
        """Count a search for the line that begins: how many there were here by then, with this one."""
        self._searches = self._searches + 1 if self._apart < SEARCH_APART else 1
        return self._searches

    def found(self) -> None:
        """A search ended on the line."""
        self._begin()
        self._searched, self._patience = self.place, LOST_TIME

    @property
    def _apart(self) -> float:
        """m from the last search to the last edge."""
        return self.place - self._searched

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
        here, on = self._robot.estimate, abs(coverage - 0.5) < MOST_OFF
        if abs(coverage - self._level) > ALIKE:
            self._level, self._since, self._believed = coverage, here.distance, False
        if abs(coverage - 0.5) < HALF:
            self._straight = here.heading
        if on:
            if not self._on:
                self._met = here.distance
            self.place, self.pointing, self.time = here.distance, here.heading, self._robot.time
            self._patience = LOST_TIME
            if self._apart > SEARCH_APART:  # before, it may still come across the line
                self.heading = here.heading
            if self.kept:
                self.to_black = None
        elif self.to_black is None:
            self.to_black = coverage > 0.5
        self._on = on
        return on
