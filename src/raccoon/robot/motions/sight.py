"""What a robot sees of the line that it follows, with one tophat on an edge or with two around the line."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from raccoon.core.errors import ConfigError
from raccoon.robot.motions.lines import check_sides, tophat_ahead

if TYPE_CHECKING:
    from raccoon.robot.parts.tophats import TophatSensor
    from raccoon.robot.robot import Robot

MOST_OFF = 0.4
"""Off from half of a sensor's spot on black, from which on it is as good as on one surface."""
WELL = 0.15
"""Off from half, at the most, of a sensor that keeps to its edge well."""
ABRUPT = 0.008
"""m of the way in which a sensor comes from the edge to black, at the most, where another line crosses within
50 degrees of square."""
HALF_ON = 0.35
"""Off from half of the spot on black, at the most, of a tophat that somebody put on an edge."""
CONTACT = 0.25
"""Share of the spot by which two sensors differ, where an edge is what makes them differ."""
SKIM = 0.2
"""Off up to which two sensors that see no edge look for one, to where one of them just sees it."""
TAPE, SPOT = 0.05, 0.01
"""m, the width of a line on Botball's tables, and of what a sensor sees of it."""
INSIDE = 0.045
"""m: two sensors that are less apart see a line's edges from within, and others from beside it."""
LEAST_APART, MOST_APART, ABREAST = 0.01, 0.1, 0.03
"""m that two sensors are apart, and that one may be ahead of the other. Nearer than a spot both see the same;
further apart the line goes from one to the other unseen for more than 4 cm."""


class Sight(ABC):
    """What is seen of the line, as of the last `look`.

    sensors: those that look. name: theirs, for messages. reach: m that they are ahead of the axis. abrupt: m
    of the way in which they come to black where another line crosses. play: m across that the line may move
    unseen. alike: shares of black that differ by less are the same.

    off: how far the robot is off the line, as a share of a spot; above 0 it must turn left. level: share of
    the spots on black. way: 1 where the line is to the left of what was seen last, -1 to the right. sees:
    whether a floor is seen at all. on: whether an edge of the line is. well: whether the robot keeps to it
    well. black: whether nothing but black is seen. plain: whether no light could make a floor read so.
    learns: whether `off` tells of a bend. leaves: whether it may still be, in part, on a line that crosses.
    """

    alike: float

    def __init__(self, sensors: tuple[TophatSensor, ...], abrupt: float, play: float = 0.0) -> None:
        self.sensors, self.abrupt, self.play = sensors, abrupt, play
        names = " and ".join(each.name for each in sensors)
        self.name = f"tophat{'s' if len(sensors) > 1 else ''} {names}"
        self.reach = sum(each.config.forward for each in sensors) / len(sensors)
        self.off, self.level, self.way = 0.0, 0.5, 0.0
        self.sees = self.on = self.well = self.black = self.plain = False
        self.learns, self.leaves = True, False

    @abstractmethod
    def look(self) -> None:
        """Take what is read in this cycle. Who sees nothing is to go straight on, and is on no edge."""

    @abstractmethod
    def edge(self, way: float) -> tuple[TophatSensor, float]:
        """The sensor that looks for a line to the left (1) or to the right (-1), and for which of its edges:
        1 is the left one, -1 the right one."""

    @property
    def other_light(self) -> bool:
        """Whether one reads what neither of its surfaces does."""
        return any(each.other_light for each in self.sensors)

    def follow_light(self, on: bool) -> None:
        """See `TophatSensor.follow_light`."""
        for each in self.sensors:
            each.follow_light(on)


class OneEdge(Sight):
    """A sensor on one edge of the line: `side` is 1 for the left one, -1 for the right one."""

    alike = 0.04

    def __init__(self, sensor: TophatSensor, side: float) -> None:
        super().__init__((sensor,), ABRUPT)
        self._sensor, self._side, self.way = sensor, side, -side

    def look(self) -> None:
        """See `Sight`. On the left edge black is to the right: too much of it means too far right."""
        coverage = self._sensor.coverage
        self.sees = self._sensor.sees and coverage is not None
        self.level = level = coverage if coverage is not None and self.sees else 0.5
        self.off = self._side * (level - 0.5)
        self.on = self.sees and -MOST_OFF < level - 0.5 < MOST_OFF
        self.well = -WELL < level - 0.5 < WELL
        self.black = level - 0.5 >= MOST_OFF
        self.leaves = level - 0.5 >= WELL
        self.way = self._side if level > 0.5 else -self._side

    def edge(self, way: float) -> tuple[TophatSensor, float]:  # noqa: ARG002
        """There is but one."""
        return self._sensor, self._side


class BothEdges(Sight):
    """Two sensors: beside the line, on its edges or on the line itself, so the darker one is on its side.

    Where both see the same, the robot goes on to where one of them just sees the edge that was seen last.
    """

    alike = 0.15

    def __init__(self, left: TophatSensor, right: TophatSensor) -> None:
        apart = left.config.left - right.config.left
        super().__init__((left, right), apart + ABRUPT, max(abs(apart - TAPE) + SPOT, 0.0))
        self._left, self._right, self.way = left, right, 1.0
        self._inside = apart < INSIDE

    def look(self) -> None:
        """See `Sight`."""
        left, right = self._left.coverage, self._right.coverage
        if left is None or right is None or not (self._left.sees and self._right.sees):
            self.off, self.level = 0.0, 0.5
            self.sees = self.on = self.black = self.plain = self.learns = self.leaves = False
            self.well = True
            return
        differ, off = left - right, 0.5 * (left + right) - 0.5
        self.sees, self.level = True, off + 0.5
        self.plain = not -CONTACT < differ < CONTACT
        if self.plain:
            self.way = 1.0 if differ > 0.0 else -1.0
        self.on = self.learns = self.plain or -MOST_OFF < off < MOST_OFF
        self.black = off >= MOST_OFF
        # Two that are half on black are on both edges, and seek none; nor do those that see what they do not
        # see around a line: the floor, where they sit on it, or black, where another line crosses.
        seek = 4.0 * (off if self._inside else -off)
        self.off = 0.5 * differ - SKIM * self.way * (0.0 if seek < 0.0 else seek if seek < 1.0 else 1.0)
        # One that comes to black where a line crosses is no more on its edge, though both may be alike then.
        self.well = -WELL < self.off < WELL and off < (MOST_OFF if self._inside else WELL)
        self.leaves = not self.well and off > -0.5 + CONTACT

    def edge(self, way: float) -> tuple[TophatSensor, float]:
        """See `Sight`."""
        return (self._right, -1.0) if way < 0.0 else (self._left, 1.0)


def check_both(robot: Robot, left: str, right: str) -> None:
    """Raise ConfigError where robot.toml has two tophats that cannot follow a line together."""
    check_sides(robot, left, right)
    first, second = tophat_ahead(robot, left).config, tophat_ahead(robot, right).config
    apart = first.left - second.left
    if not LEAST_APART <= apart <= MOST_APART:
        raise ConfigError(
            f"tophats {left} and {right} are {apart:g} m apart in robot.toml: to follow a line of 5 cm "
            f"together they must be {LEAST_APART:g} to {MOST_APART:g} m apart"
        )
    if abs(first.forward - second.forward) > ABREAST:
        raise ConfigError(
            f"tophats {left} and {right} are {first.forward:g} and {second.forward:g} m ahead of the axis: "
            f"to follow a line together they must be beside each other, to {ABREAST:g} m"
        )


def other_on_edge(robot: Robot, sight: Sight) -> str:
    """The tophat that is on an edge where none of `sight` is, "" for none. A robot is put down with the one
    that is to follow on the edge, so that is what exchanged plugs read."""
    on = [
        each for each in robot.tophats.values() if each.sees and abs((each.coverage or 0.0) - 0.5) < HALF_ON
    ]
    return "" if not on or any(each in on for each in sight.sensors) else on[0].name
