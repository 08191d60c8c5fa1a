"""Where a robot that follows a line last saw its edge, and whether it really was an edge."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

from raccoon.core.errors import MotionTimeout
from raccoon.model.pose import Pose
from raccoon.robot.motions.line_sight import MAX_EDGE_OFFSET

if TYPE_CHECKING:
    from raccoon.robot.motions.line_sight import LineSight
    from raccoon.robot.robot import Robot

SHORT_EDGE = 0.03
"""m of an edge; on a shorter one the sensor only went across."""
STEADY_WAY_M, HALF_COVERAGE_MARGIN = 0.05, 0.02
"""m of way with a steady reading that is doubted, and the distance from half of the spot within which a
reading counts as half."""
EDGE_MARGIN = 0.05
"""Hysteresis: an edge counts again when it is nearer to half than `MAX_EDGE_OFFSET` by this much."""
LOST_TIME, LOST_WAY, NONE_YET_TIME = 1.0, 0.15, 0.5
"""s and m without an edge after which the line is lost; s if there was no edge yet."""
PLAY_TIME, PLAY_WAY = 60.0, 5.0
"""s and m more for each m of unseen width between the sensors."""
TRAIL_STEP_M, TRAIL_POSES = 0.01, 20
"""m between two poses of the way along the line that are remembered, and their number."""
BACK_ANGLE, SAME_PLACE_M = math.radians(150.0), 0.015
"""rad and m within which a robot follows the line back to where it came from."""
SEARCH_APART_M = 0.05
"""m of way between two searches, below which both are for the same place."""


class LastEdge:
    """Where the sensor was last on an edge of the line.

    place: m of way. time: s. heading: rad of the line, as far as known. robot_heading: rad of the robot
    there, None before the first edge. direction: where the line was when the sensor left it (1 to the left,
    where it turned or another line crosses; -1 to the right), 0 while it is followed. other_tophat: the
    tophat that was on an edge at the start while the one that follows was not. kept: the place of
    the line's middle where it was last followed, rather than an edge only crossed, and the robot's heading;
    None if it was not yet. trail: such places of the last 0.2 m, 1 cm apart, oldest first.
    """

    def __init__(self, robot: Robot, play: float = 0.0, other: str = "") -> None:
        self._robot, self.other_tophat = robot, other
        self._extra_patience, self._max_way = PLAY_TIME * play, LOST_WAY + PLAY_WAY * play
        self.direction = 0.0
        self._patience, self._searches = NONE_YET_TIME + self._extra_patience, 0
        self._begin_here()

    def _begin_here(self) -> None:
        """Begin without knowing any edge, as in another frame after the odometry was reset."""
        self._resets = self._robot.odometry.resets
        self.heading = self._robot.estimate.heading
        self.robot_heading: float | None = None
        self.kept: Pose | None = None
        self.trail: deque[Pose] = deque(maxlen=TRAIL_POSES)
        self._level, self._level_since, self._is_decided = 0.5, 0.0, False
        self._straight_heading = self.heading  # where it last read half an edge, as on a straight line
        self._last_search = -math.inf
        self._mark_edge_here()

    def _mark_edge_here(self) -> None:
        """Take the present place for an edge."""
        self.place = self._edge_start = self._robot.estimate.distance
        self.time = self._robot.time
        self._is_on_edge = True

    @property
    def is_lost(self) -> bool:
        """Whether there was no edge for too long a time or way."""
        here = self._robot
        return here.time - self.time > self._patience or here.estimate.distance - self.place > self._max_way

    @property
    def missed_for(self) -> str:
        """Time and way without an edge after which the line is lost."""
        return f"no edge for {self._patience:.3g} s or {self._max_way:.2g} m"

    def count_search(self) -> int:
        """Count a search for the line that begins; returns the number of searches at this place."""
        self._searches = self._searches + 1 if self._way_since_search < SEARCH_APART_M else 1
        return self._searches

    def mark_found(self) -> None:
        """Note that a search ended on the line."""
        self._mark_edge_here()
        self._last_search, self._patience = self.place, LOST_TIME + self._extra_patience

    @property
    def _way_since_search(self) -> float:
        """m of way from the last search to the last edge."""
        return self.place - self._last_search

    @property
    def is_kept(self) -> bool:
        """Whether the sensor follows the edge, rather than only crossing it."""
        return self.place - self._edge_start > SHORT_EDGE

    @property
    def is_doubtful(self) -> bool:
        """Whether the reading is steady for a while and not half: so reads an edge in a bend, and the floor
        in another light."""
        steady = self.place - self._level_since > STEADY_WAY_M
        return (
            steady
            and self._is_on_edge
            and not self._is_decided
            and HALF_COVERAGE_MARGIN < abs(self._level - 0.5) < MAX_EDGE_OFFSET
        )

    def decide(self, edge: bool) -> None:
        """Take the result of the test of a doubtful edge. If it is no edge, the line is assumed to go on as
        before."""
        self._is_decided = True
        if not edge:
            self.heading = self._straight_heading

    def update(self, sight: LineSight) -> bool:
        """Take the observation of this cycle; returns whether it is an edge."""
        here, level = self._robot.estimate, sight.level
        if self._robot.odometry.resets != self._resets:
            self._begin_here()
        on = sight.sees_edge and (self._is_on_edge or sight.nearest_to_half < MAX_EDGE_OFFSET - EDGE_MARGIN)
        if sight.is_unambiguous or abs(level - self._level) > sight.same_level:
            self._level, self._level_since, self._is_decided = level, here.distance, sight.is_unambiguous
        if abs(sight.offset) < HALF_COVERAGE_MARGIN:
            self._straight_heading = here.heading
        if on:
            if not self._is_on_edge:
                self._edge_start = self._level_since = here.distance
            self.place, self.robot_heading, self.time = here.distance, here.heading, self._robot.time
            self._patience = LOST_TIME + self._extra_patience
            if self._way_since_search > SEARCH_APART_M:  # before, it may still come across the line
                self.heading = here.heading
            if self.is_kept:
                self.direction = 0.0
                self._mark_kept(sight.line_middle(Pose(here.x, here.y, here.heading)), sight.name)
        elif self.direction == 0.0:
            self.direction = sight.direction
        self._is_on_edge = on
        return on

    def _mark_kept(self, middle: Pose, name: str) -> None:
        """Note that the robot follows the line here. middle: the place of the line's middle, and the robot's
        heading. Raises MotionTimeout if that is where it came along the other way: it went around the end of
        the line, or around the tip of a corner, and would drive back."""
        self.kept = middle
        last = self.trail[-1] if self.trail else None
        if last is not None and math.hypot(middle.x - last.x, middle.y - last.y) < TRAIL_STEP_M:
            return
        for each in self.trail:
            turned = abs(math.remainder(middle.heading - each.heading, math.tau))
            if turned > BACK_ANGLE and math.hypot(middle.x - each.x, middle.y - each.y) < SAME_PLACE_M:
                raise MotionTimeout(
                    f"{name} lost the line: the robot came back along it, so it ends at {middle.x:.2f}, "
                    f"{middle.y:.2f} m or turns back in a sharp corner before that: "
                    "follow its other edge, or end the action before"
                )
        self.trail.append(middle)
