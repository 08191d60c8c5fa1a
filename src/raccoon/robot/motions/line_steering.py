"""Steering along an edge of a line: proportional to the offset, plus the line's bend."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.robot.motions.line_sight import MAX_EDGE_OFFSET

if TYPE_CHECKING:
    from raccoon.robot.motions.line_sight import LineSight
    from raccoon.robot.robot import Robot

LINE_GAIN = 1.5
"""rad/s per unit of coverage, for a sensor 0.11 m ahead of the axle. The spot is about 10 mm wide, so the
error decays at 0.11 * 1.5 / 0.01 = 16 /s, a fifth of the rate at which 30 ms of delay becomes unstable."""
USUAL_REACH = 0.11
BEND_LEARN_RATE, BEND_FORGET_RATE = 4.0, 8.0
"""/s at which the line's bend is learnt, a quarter of the steering's rate so that the two do not oscillate,
and at which it is forgotten after a bend."""
MAX_BEND, MIN_LEARN_SPEED = 1.0 / 0.06, 0.05
"""Tightest bend that is learnt, rad/m, and m/s below which it is learnt as at that speed."""
BEND_FORGET_WAY_M = 0.05
"""m of way on which a bend is forgotten while no edge is seen."""
SEEK_GAIN = 100.0
"""rad/m per m of way and unit of coverage, by which the robot then turns tighter and tighter, as the line may
bend like that."""
MAX_SEEN_OFFSET = 0.48
"""Distance from half of the spot on black within which the sensor sees the edge."""
MAX_CROSSING_WAY_M, MIN_KEPT_WAY_M = 0.08, 0.03
"""Longest way on a crossing line, and least way on which the robot followed its edge well before it, m."""
STRAIGHT_GAIN = 3.0
"""rad/s a rad off the way that it came, over a line that crosses."""
FLICKER_WAY_M, SETTLED_WAY_M = 0.005, 0.02
"""m of the way on which what is seen may be otherwise, by noise; and on which a steady bend is known."""
MIN_ASIDE_M, STEEP_SLOPE = 0.005, 0.7
"""m that the sensor went aside along another edge, at the least, and how much of the way that is: in a bend
of 6 cm it is less than half, along an edge that lies 35 degrees off it is this."""
FULL_SPEED_OFFSET, MIN_SPEED = 0.25, 0.03
"""Off from half up to which a bend is taken at full speed, and m/s of one that is not seen any more."""
MAX_STRAIGHT_BEND = 3.0
"""rad a metre up to which a line is straight: where one bend ends in another to the other side, the sensor
comes to black as fast as at a crossing."""


class LineSteering:
    """Keeps a sensor on an edge: a turn rate in proportion to its offset, plus that of the line's bend.

    The bend is what the robot turned there lately, so that the sensor need not be off the edge to turn: a
    bend that asks for more than half of its spot could give is followed all the same.
    """

    def __init__(self, robot: Robot, sight: LineSight) -> None:
        self._robot, self._sight = robot, sight
        self._gain = LINE_GAIN * USUAL_REACH / sight.reach
        self._bend = 0.0  # rad a metre, left positive
        self._steady_bend = 0.0  # what that was while the sensor kept to the edge well
        self._kept_until = self._kept_from = -math.inf  # m of the way, up to where and from where it did so
        self._crossing_side = 0.0  # the side on which it came to another line first
        self._kept_heading = 0.0  # rad, of the robot where it kept to the edge well
        self._resets = robot.odometry.resets
        self._was_black = False  # whether it came to black
        self._last_black = 0.0  # m of the way, where it was
        self.is_crossing = False
        """Whether the sensor is on a line that crosses the one that it follows."""

    def restart(self) -> None:
        """Forget the bend, as after a search."""
        self._bend, self._kept_until = 0.0, -math.inf
        self._was_black, self.is_crossing = True, False

    def turn_rate(self, velocity: float) -> float:
        """rad/s for this cycle. velocity: m/s asked for."""
        off = self._sight.offset
        if self._robot.odometry.resets != self._resets:
            self._resets = self._robot.odometry.resets
            self.restart()
        if self._update_crossing():
            here = self._robot.estimate
            ahead = self._kept_heading + self._bend * (here.distance - self._kept_until)
            return self._bend * velocity + STRAIGHT_GAIN * (ahead - here.heading)
        is_bend_over = off * self._bend < 0.0
        if is_bend_over and not -MAX_EDGE_OFFSET < off < MAX_EDGE_OFFSET:
            self._bend = 0.0
        if not self._sight.tells_bend:
            way = velocity * self._robot.dt
            self._bend += SEEK_GAIN * off * way - (
                self._bend * way / BEND_FORGET_WAY_M if is_bend_over else 0.0
            )
        elif -MAX_SEEN_OFFSET < off < MAX_SEEN_OFFSET:
            learnt = (
                (BEND_FORGET_RATE if is_bend_over else BEND_LEARN_RATE) * self._gain * off * self._robot.dt
            )
            bend = self._bend + learnt / (velocity if velocity > MIN_LEARN_SPEED else MIN_LEARN_SPEED)
            self._bend = -MAX_BEND if bend < -MAX_BEND else MAX_BEND if bend > MAX_BEND else bend
        return self._gain * off + self._bend * velocity

    def _update_crossing(self) -> bool:
        """Update whether another line crosses here: then the robot goes on as it went."""
        here, sight = self._robot.estimate.distance, self._sight
        if sight.is_kept and not self.is_crossing:
            self._mark_kept(here)
        way = here - self._kept_until
        if not self.is_crossing:
            came_to_black, self._was_black = sight.all_black and not self._was_black, sight.all_black
            if self._meets_crossing(came_to_black, way):
                self.is_crossing = True
                self._crossing_side, self._bend, self._last_black = sight.direction, self._steady_bend, here
            return self.is_crossing
        if sight.all_black:
            self._was_black, self._last_black = True, here
        # The sensor that came to it first leaves it first; in a bend the other one leaves the line.
        bends = sight.is_unambiguous and sight.direction == self._crossing_side
        leaves = sight.may_be_crossing and not bends
        is_over = sight.turns_off or (
            self._was_black and here - self._last_black > (sight.abrupt_way if leaves else FLICKER_WAY_M)
        )
        self.is_crossing = not is_over and way < MAX_CROSSING_WAY_M + sight.abrupt_way
        return self.is_crossing

    def _meets_crossing(self, came_to_black: bool, way: float) -> bool:
        """Whether an edge lies across what was straight up to `way` m ago. came: whether all is black now.

        A robot that is slow follows the edge of the line that crosses before it is on it: where it turned
        aside more steeply than in any bend, that edge is another line's.
        """
        turned = self._robot.estimate.heading - self._kept_heading
        aside = self._sight.reach * max(turned if self._sight.offset > 0.0 else -turned, 0.0)
        abrupt = came_to_black and way < self._sight.abrupt_way
        steep = aside > max(STEEP_SLOPE * way, MIN_ASIDE_M)
        kept = (
            self._kept_until - self._kept_from > MIN_KEPT_WAY_M and abs(self._steady_bend) < MAX_STRAIGHT_BEND
        )
        return kept and way < MAX_CROSSING_WAY_M and (abrupt or steep) and not self._sight.turns_off

    def _mark_kept(self, here: float) -> None:
        """Note that the robot keeps to the edge well, `here` m of the way."""
        way = here - self._kept_until
        if way > FLICKER_WAY_M:
            self._kept_from, self._steady_bend = here, self._bend
        elif way > 0.0:
            self._steady_bend += way / SETTLED_WAY_M * (self._bend - self._steady_bend)
        self._kept_until, self._kept_heading = here, self._robot.estimate.heading

    def limited_speed(self, top: float) -> float:
        """m/s, at the most `top`: less in a bend that takes the sensor to the end of the edge all the same,
        as one tighter than the sensor is ahead: around that the robot turns nearly on the spot."""
        off = self._sight.offset
        further = (off if self._bend > 0.0 else -off) - FULL_SPEED_OFFSET
        if (
            further < 0.0
            or -MAX_STRAIGHT_BEND < self._bend < MAX_STRAIGHT_BEND
            or self.is_crossing
            or top < MIN_SPEED
        ):
            return top
        return top - (top - MIN_SPEED) * further / (0.5 - FULL_SPEED_OFFSET)
