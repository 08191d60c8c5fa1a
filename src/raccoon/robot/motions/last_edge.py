"""What a robot that follows a line knows of it: where its edge was last, and whether it is one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.robot.motions.sight import MOST_OFF

if TYPE_CHECKING:
    from raccoon.robot.motions.sight import Sight
    from raccoon.robot.robot import Robot

SHORT_EDGE = 0.03
"""m of an edge below which the sensor only went across it."""
STEADY, HALF = 0.05, 0.02
"""m of the way, and off from half of the sensor's spot: what is nearer is half."""
SURELY = 0.05
"""Nearer to half than `MOST_OFF`, from which on it is an edge again: a floor that reads just so is none."""
LOST_TIME, LOST_WAY, NONE_YET_TIME = 1.0, 0.15, 0.5
"""s and m without an edge under the sensor after which the line is lost; s where there was none yet."""
PLAY_TIME, PLAY_WAY = 60.0, 5.0
"""s and m more a m across that the line may move unseen."""
SEARCH_APART = 0.05
"""m of the way that one search for the line is from the next, or both are for the same place."""


class LastEdge:
    """Where the sensor was on an edge of the line the last time.

    place: m of the way. time: s. heading: rad of the line, as far as known. pointing: rad of the robot there,
    None before the first edge. way: where the line was when it was left (1 to the left, where it turned to or
    another one crosses it, -1 to the right), 0 while it is kept to. doubtful: whether the same is read for a
    while, and not half an edge: one in a bend does, and so does the floor in other light. other: the tophat
    that was on an edge at the start, where what follows was on none.
    """

    def __init__(self, robot: Robot, play: float = 0.0, other: str = "") -> None:
        self._robot, self.other = robot, other
        self._more, self._way = PLAY_TIME * play, LOST_WAY + PLAY_WAY * play
        self.heading = robot.estimate.heading
        self.pointing: float | None = None
        self.way = 0.0
        self._level, self._since, self._believed = 0.5, 0.0, False
        self._straight = self.heading  # when it last read half an edge, as where the line goes straight on
        self._patience, self._searched, self._searches = NONE_YET_TIME + self._more, -math.inf, 0
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
        return here.time - self.time > self._patience or here.estimate.distance - self.place > self._way

    @property
    def missed(self) -> str:
        """After how long, and on how long a way, a line without an edge is lost here."""
        return f"no edge for {self._patience:.3g} s or {self._way:.2g} m"

    def searches(self) -> int:
        """Count a search for the line that begins: how many there were here by then, with this one."""
        self._searches = self._searches + 1 if self._apart < SEARCH_APART else 1
        return self._searches

    def found(self) -> None:
        """A search ended on the line."""
        self._begin()
        self._searched, self._patience = self.place, LOST_TIME + self._more

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
        return steady and self._on and not self._believed and HALF < abs(self._level - 0.5) < MOST_OFF

    def believe(self, edge: bool) -> None:
        """It was found out whether it is an edge; where it is none, the line goes as it did before."""
        self._believed = True
        if not edge:
            self.heading = self._straight

    def see(self, sight: Sight) -> bool:
        """Take what is seen in this cycle; whether it is an edge."""
        here, level = self._robot.estimate, sight.level
        on = sight.on and (self._on or sight.plain or abs(level - 0.5) < MOST_OFF - SURELY)
        if sight.plain or abs(level - self._level) > sight.alike:
            self._level, self._since, self._believed = level, here.distance, sight.plain
        if abs(sight.off) < HALF:
            self._straight = here.heading
        if on:
            if not self._on:
                self._met = self._since = here.distance
            self.place, self.pointing, self.time = here.distance, here.heading, self._robot.time
            self._patience = LOST_TIME + self._more
            if self._apart > SEARCH_APART:  # before, it may still come across the line
                self.heading = here.heading
            if self.kept:
                self.way = 0.0
        elif self.way == 0.0:
            self.way = sight.way
        self._on = on
        return on
