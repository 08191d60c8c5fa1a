"""Steering along an edge of a line: in proportion to how far off it is, and with its bends."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.robot.motions.sight import MOST_OFF

if TYPE_CHECKING:
    from raccoon.robot.motions.sight import Sight
    from raccoon.robot.robot import Robot

LINE_GAIN = 1.5
"""rad/s a unit of coverage, for a sensor 0.11 m ahead of the axis. The spot is about 10 mm wide, so the
sensor closes in at 0.11 * 1.5 / 0.01 = 16 /s: a fifth of what 30 ms of delay would bear."""
USUAL_REACH = 0.11
BEND_GAIN, OVER_GAIN = 4.0, 8.0
"""/s at which the line's bend is learnt: a quarter of that, so that both together do not swing; and at which
it is forgotten where it is over."""
TIGHTEST, SLOW = 1.0 / 0.06, 0.05
"""rad a metre of the tightest bend that is learnt, and m/s below which it is learnt as at that speed."""
FORGETS = 0.05
"""m of the way on which a bend is forgotten where no edge tells of it."""
SEEKS = 100.0
"""rad a metre, a metre of the way and a unit of coverage, by which the robot then turns more and more: the
line may bend as it does."""
SEEN = 0.48
"""Off from half of the spot on black, up to which the sensor sees the edge."""
CROSSING, KEPT = 0.08, 0.03
"""m on a line that crosses, at the most, and m that the robot kept to its edge well before it."""
STRAIGHT_GAIN = 3.0
"""rad/s a rad off the way that it came, over a line that crosses."""
FLICKER, SETTLED = 0.005, 0.02
"""m of the way on which what is seen may be otherwise, by noise; and on which a steady bend is known."""
LEAST_ASIDE, STEEP = 0.005, 0.7
"""m that the sensor went aside along another edge, at the least, and how much of the way that is: in a bend
of 6 cm it is less than half, along an edge that lies 35 degrees off it is this."""
CALM, LEAST_SPEED = 0.25, 0.03
"""Off from half up to which a bend is taken at full speed, and m/s of one that is not seen any more."""
STRAIGHT = 3.0
"""rad a metre up to which a line is straight: where one bend ends in another to the other side, the sensor
comes to black as fast as at a crossing."""


class Steering:
    """What keeps a sensor on an edge: a turn rate in proportion to how far off it is, and that of the bend.

    The bend is what the robot turned there lately, so that the sensor need not be off the edge to turn: a
    bend that asks for more than half of its spot could give is followed all the same.
    """

    def __init__(self, robot: Robot, sight: Sight) -> None:
        self._robot, self._sight = robot, sight
        self._gain = LINE_GAIN * USUAL_REACH / sight.reach
        self._bend = 0.0  # rad a metre, left positive
        self._steady = 0.0  # what that was while the sensor kept to the edge well
        self._edge = self._began = -math.inf  # m of the way, up to where and from where it did so
        self._came = 0.0  # the side on which it came to another line first
        self._heading = 0.0  # rad, of the robot where it kept to the edge well
        self._black, self._last_black = False, 0.0  # whether it came to black, and m of the way where it was
        self.crosses = False
        """Whether the sensor is on a line that crosses the one that it follows."""

    def restart(self) -> None:
        """Know of no bend, as after a search."""
        self._bend, self._edge = 0.0, -math.inf
        self._black, self.crosses = True, False

    def turn_rate(self, velocity: float) -> float:
        """rad/s for this cycle. velocity: m/s asked for."""
        off = self._sight.off
        if self._is_crossing():
            here = self._robot.estimate
            ahead = self._heading + self._bend * (here.distance - self._edge)
            return self._bend * velocity + STRAIGHT_GAIN * (ahead - here.heading)
        over = off * self._bend < 0.0
        if over and not -MOST_OFF < off < MOST_OFF:
            self._bend = 0.0
        if not self._sight.learns:
            way = velocity * self._robot.dt
            self._bend += SEEKS * off * way - (self._bend * way / FORGETS if over else 0.0)
        elif -SEEN < off < SEEN:
            learnt = (OVER_GAIN if over else BEND_GAIN) * self._gain * off * self._robot.dt
            bend = self._bend + learnt / (velocity if velocity > SLOW else SLOW)
            self._bend = -TIGHTEST if bend < -TIGHTEST else TIGHTEST if bend > TIGHTEST else bend
        return self._gain * off + self._bend * velocity

    def _is_crossing(self) -> bool:
        """Whether another line crosses here: then the robot goes on as it went."""
        here, sight = self._robot.estimate.distance, self._sight
        if sight.well and not self.crosses:
            self._keep(here)
        way = here - self._edge
        if not self.crosses:
            came, self._black = sight.black and not self._black, sight.black
            if self._meets_another(came, way):
                self.crosses = True
                self._came, self._bend, self._last_black = sight.way, self._steady, here
            return self.crosses
        if sight.black:
            self._black, self._last_black = True, here
        # The sensor that came to it first leaves it first; in a bend the other one leaves the line.
        bends = sight.plain and sight.way == self._came
        leaves = sight.leaves and not bends
        over = self._black and here - self._last_black > (sight.abrupt if leaves else FLICKER)
        self.crosses = not over and way < CROSSING + sight.abrupt
        return self.crosses

    def _meets_another(self, came: bool, way: float) -> bool:
        """Whether an edge lies across what was straight up to `way` m ago. came: whether all is black now.

        A robot that is slow follows the edge of the line that crosses before it is on it: where it turned
        aside more steeply than in any bend, that edge is another line's.
        """
        turned = self._robot.estimate.heading - self._heading
        aside = self._sight.reach * max(turned if self._sight.off > 0.0 else -turned, 0.0)
        abrupt = came and way < self._sight.abrupt
        steep = aside > max(STEEP * way, LEAST_ASIDE)
        kept = self._edge - self._began > KEPT and abs(self._steady) < STRAIGHT
        return kept and way < CROSSING and (abrupt or steep)

    def _keep(self, here: float) -> None:
        """The robot keeps to the edge well, `here` m of the way."""
        way = here - self._edge
        if way > FLICKER:
            self._began, self._steady = here, self._bend
        elif way > 0.0:
            self._steady += way / SETTLED * (self._bend - self._steady)
        self._edge, self._heading = here, self._robot.estimate.heading

    def limit(self, top: float) -> float:
        """m/s, at the most `top`: less in a bend that takes the sensor to the end of the edge all the same,
        as one tighter than the sensor is ahead: around that the robot turns nearly on the spot."""
        off = self._sight.off
        further = (off if self._bend > 0.0 else -off) - CALM
        if further < 0.0 or -STRAIGHT < self._bend < STRAIGHT or self.crosses or top < LEAST_SPEED:
            return top
        return top - (top - LEAST_SPEED) * further / (0.5 - CALM)
