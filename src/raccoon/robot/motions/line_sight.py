"""The line as seen by the robot that follows it, with one tophat on an edge or with two around the line."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from raccoon.core.errors import ConfigError
from raccoon.model.pose import Pose
from raccoon.robot.motions.lines import check_sides, tophat_ahead

if TYPE_CHECKING:
    from raccoon.robot.parts.tophats import TophatSensor
    from raccoon.robot.robot import Robot

MAX_EDGE_OFFSET = 0.4
"""Distance from half of the spot on black beyond which a sensor counts as on one surface."""
MAX_KEPT_OFFSET = 0.15
"""Largest distance from half of a sensor that follows its edge well."""
ABRUPT_WAY_M = 0.008
"""m; a sensor that comes from the edge to all black within this way is at a line that crosses within 50
degrees of square."""
MAX_START_OFFSET = 0.35
"""Largest distance from half of the spot on black of a tophat that was put down on an edge."""
MIN_DIFFERENCE = 0.25
"""Least difference of two sensors' shares on black that an edge makes."""
SKIM_OFFSET = 0.2
"""Distance from half at which two sensors that see no edge search for one: there one of them just sees it."""
TAPE_WIDTH_M, SPOT_WIDTH_M = 0.05, 0.01
"""m, the width of a line on Botball's tables and of a sensor's spot."""
MAX_INSIDE_DISTANCE_M = 0.045
"""m; two sensors nearer to each other see the line's edges from inside, others from beside the line."""
MIN_DISTANCE_M, MAX_DISTANCE_M, MAX_FORWARD_DIFFERENCE_M = 0.01, 0.1, 0.03
"""Least and largest distance of two sensors, and largest difference in how far ahead they are, m. Nearer than
a spot both see the same; further apart the line is unseen for more than 4 cm between them."""


class LineSight(ABC):
    """What the last `look` saw of the line.

    sensors: those that look. name: theirs, for messages. reach: m that they are ahead of the axle.
    abrupt_way: m of way in which they come to black where another line crosses. unseen_width: m across which
    the line may move unseen. same_level: shares of black that differ by less count as the same.

    offset: how far the robot is off the line, as a share of a spot; above 0 it must turn left. level: share
    of the spots on black. direction: 1 if the line is to the left of what was seen last, -1 to the right.
    sees_floor: whether a floor is seen at all. sees_edge: whether an edge of the line is seen.
    nearest_to_half: distance from half of the share of the sensor that is nearest to half, 0 if only an edge
    explains both. is_kept: whether the robot follows it well. all_black: whether only black is seen.
    is_unambiguous: whether no light could make a floor read so. tells_bend: whether `offset` shows a bend.
    may_be_crossing: whether it may still be partly on a crossing line. turns_off: whether the line leaves to
    one side, so that none crosses.
    """

    same_level: float

    def __init__(self, sensors: tuple[TophatSensor, ...], abrupt: float, play: float = 0.0) -> None:
        self.sensors, self.abrupt_way, self.unseen_width = sensors, abrupt, play
        names = " and ".join(each.name for each in sensors)
        self.name = f"tophat{'s' if len(sensors) > 1 else ''} {names}"
        self.reach = sum(each.config.forward for each in sensors) / len(sensors)
        self.offset, self.level, self.direction, self.nearest_to_half = 0.0, 0.5, 0.0, 0.5
        self.sees_floor = self.sees_edge = self.is_kept = self.all_black = self.is_unambiguous = False
        self.tells_bend, self.may_be_crossing, self.turns_off = True, False, False
        self._line_left = sum(each.config.left for each in sensors) / len(sensors)

    def line_middle(self, robot: Pose) -> Pose:
        """The place (heading: the robot's) of the line's middle between or beside the sensors of a robot at
        this pose that follows it well."""
        ahead = robot.ahead(self.reach)
        side = ahead.turned(0.5 * math.pi).ahead(self._line_left)
        return Pose(side.x, side.y, robot.heading)

    @abstractmethod
    def look(self) -> None:
        """Take the readings of this cycle. Without any the robot goes straight on, and is on no edge."""

    @abstractmethod
    def edge(self, way: float) -> tuple[TophatSensor, float]:
        """The sensor that searches for a line to the left (1) or to the right (-1), and for which of its
        edges: 1 is the left one, -1 the right one."""

    @property
    def other_light(self) -> bool:
        """Whether a sensor reads what neither of its surfaces does."""
        return any(each.other_light for each in self.sensors)

    def follow_light(self, on: bool) -> None:
        """See `TophatSensor.follow_light`."""
        for each in self.sensors:
            each.follow_light(on)


class OneEdge(LineSight):
    """A sensor on one edge of the line: `side` is 1 for the left one, -1 for the right one."""

    same_level = 0.04

    def __init__(self, sensor: TophatSensor, side: float) -> None:
        super().__init__((sensor,), ABRUPT_WAY_M)
        self._sensor, self._side, self.direction = sensor, side, -side
        self._line_left -= 0.5 * side * TAPE_WIDTH_M

    def look(self) -> None:
        """See `LineSight`. On the left edge black is to the right: too much of it means too far right."""
        coverage = self._sensor.coverage
        self.sees_floor = self._sensor.sees and coverage is not None
        self.level = level = coverage if coverage is not None and self.sees_floor else 0.5
        self.offset = self._side * (level - 0.5)
        self.nearest_to_half = abs(level - 0.5)
        self.sees_edge = self.sees_floor and self.nearest_to_half < MAX_EDGE_OFFSET
        self.is_kept = -MAX_KEPT_OFFSET < level - 0.5 < MAX_KEPT_OFFSET
        self.all_black = level - 0.5 >= MAX_EDGE_OFFSET
        self.may_be_crossing = level - 0.5 >= MAX_KEPT_OFFSET
        self.direction = self._side if level > 0.5 else -self._side

    def edge(self, way: float) -> tuple[TophatSensor, float]:  # noqa: ARG002
        """The only one."""
        return self._sensor, self._side


class BothEdges(LineSight):
    """Two sensors beside the line, on its edges or on the line itself: the line is on the side of the darker
    one. If both see the same, the robot goes to where one of them just sees the edge that was seen last."""

    same_level = 0.15

    def __init__(self, left: TophatSensor, right: TophatSensor) -> None:
        apart = left.config.left - right.config.left
        super().__init__(
            (left, right), apart + ABRUPT_WAY_M, max(abs(apart - TAPE_WIDTH_M) + SPOT_WIDTH_M, 0.0)
        )
        self._left, self._right, self.direction = left, right, 1.0
        self._inside = apart < MAX_INSIDE_DISTANCE_M
        self._both_on_line = apart < TAPE_WIDTH_M + 0.5 * SPOT_WIDTH_M

    def look(self) -> None:
        """See `LineSight`."""
        left, right = self._left.coverage, self._right.coverage
        if left is None or right is None or not (self._left.sees and self._right.sees):
            self.offset, self.level = 0.0, 0.5
            self.sees_floor = self.sees_edge = self.all_black = self.is_unambiguous = False
            self.tells_bend = self.may_be_crossing = self.turns_off = False
            self.is_kept = True
            return
        difference, excess = left - right, 0.5 * (left + right) - 0.5
        self.sees_floor, self.level = True, excess + 0.5
        self.is_unambiguous = not -MIN_DIFFERENCE < difference < MIN_DIFFERENCE
        if self.is_unambiguous:
            self.direction = 1.0 if difference > 0.0 else -1.0
        # Where another line crosses, the one that is followed goes on under the lighter of the two.
        lighter = right if difference > 0.0 else left
        self.turns_off = self._both_on_line and self.is_unambiguous and lighter < 0.5 - MAX_EDGE_OFFSET
        # In a bend they stand askew over the line, and one is all black while the other is on its edge.
        # Of white the same is no edge: it may be a floor that is darker than its calibration says.
        darkest = min(left, right) - 0.5
        nearest = min(abs(excess), darkest) if darkest > 0.0 else abs(excess)
        self.nearest_to_half = 0.0 if self.is_unambiguous else nearest
        self.sees_edge = self.tells_bend = self.nearest_to_half < MAX_EDGE_OFFSET
        self.all_black = excess >= MAX_EDGE_OFFSET
        # Two that are half on black are on both edges, and seek none; nor do those that see what they do not
        # see around a line: the floor, where they sit on it, or black, where another line crosses.
        seek = 4.0 * (excess if self._inside else -excess)
        seek = 0.0 if seek < 0.0 else seek if seek < 1.0 else 1.0
        self.offset = 0.5 * difference - SKIM_OFFSET * self.direction * seek
        # One that comes to black where a line crosses is no more on its edge, though both may be alike then.
        most = MAX_EDGE_OFFSET if self._inside else MAX_KEPT_OFFSET
        self.is_kept = -MAX_KEPT_OFFSET < self.offset < MAX_KEPT_OFFSET and excess < most
        self.may_be_crossing = not self.is_kept and excess > -0.5 + MIN_DIFFERENCE

    def edge(self, way: float) -> tuple[TophatSensor, float]:
        """See `LineSight`."""
        return (self._right, -1.0) if way < 0.0 else (self._left, 1.0)


def check_pair(robot: Robot, left: str, right: str) -> None:
    """Raise ConfigError if robot.toml's two tophats cannot follow a line together."""
    check_sides(robot, left, right)
    first, second = tophat_ahead(robot, left).config, tophat_ahead(robot, right).config
    apart = first.left - second.left
    if not MIN_DISTANCE_M <= apart <= MAX_DISTANCE_M:
        raise ConfigError(
            f"tophats {left} and {right} are {apart:g} m apart in robot.toml: to follow a line of 5 cm "
            f"together they must be {MIN_DISTANCE_M:g} to {MAX_DISTANCE_M:g} m apart"
        )
    if abs(first.forward - second.forward) > MAX_FORWARD_DIFFERENCE_M:
        raise ConfigError(
            f"tophats {left} and {right} are {first.forward:g} and {second.forward:g} m ahead of the axis: "
            f"to follow a line together they must be beside each other, within {MAX_FORWARD_DIFFERENCE_M:g} m"
        )


def find_other_on_edge(robot: Robot, sight: LineSight) -> str:
    """The tophat that is on an edge while none of `sight` is, "" for none. A robot is put down with the
    following tophat on the edge, so this shows exchanged plugs."""
    on = [
        each
        for each in robot.tophats.values()
        if each.sees and abs((each.coverage or 0.0) - 0.5) < MAX_START_OFFSET
    ]
    return "" if not on or any(each in on for each in sight.sensors) else on[0].name
