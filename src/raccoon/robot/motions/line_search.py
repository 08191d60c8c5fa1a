"""Searching for a line on the spot, for a robot that slid off it or whose light changed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn

from raccoon.control.motion import limit_slew
from raccoon.core.errors import MotionTimeout
from raccoon.model.pose import Pose
from raccoon.robot.actions.actions import Steps
from raccoon.robot.motions.last_edge import TRAIL_POSES, TRAIL_STEP_M, LastEdge
from raccoon.robot.motions.line_sight import TAPE_WIDTH_M
from raccoon.robot.motions.lines import sensor_place
from raccoon.robot.motions.pacing import STALL_PATIENCE_S, describe_obstacle, is_at_rest
from raccoon.robot.motions.surface_levels import SurfaceLevels
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.robot.motions.line_sight import LineSight
    from raccoon.robot.robot import Robot

SEARCH_ANGLE = math.radians(90.0)
"""rad to either side of the line's direction in which it is searched for, measured at the sensor about the
middle of the axle: a sensor mounted to one side would otherwise search less far on the other side."""
CORNER_ANGLE, CORNER_SPEED, AT_CORNER_M = math.radians(165.0), 0.12, 0.01
"""The same from over the corner, m/s of the sensor there, and m within which the axle is over it."""
TIP_ANGLE = math.radians(45.0)
"""rad to either side in which the sensor then may be over the tip of the corner, which leads nowhere."""
CORNER_LEG_M, TAPE_MARGIN_M = 0.05, 0.01
"""m of the line before the corner that show its direction, and m beside a line that count as it."""
SEARCH_SPEED, SEARCH_TIME = 0.08, 12.0
"""m/s of the sensor while searching, and longest duration of a search from one place, s."""
SIGHT_TIME = 1.0
"""s to wait for the readings of a loose plug that moves no more, or of a controller that restarts, and for
readings of a robot at rest."""
BACK_SPEED = 0.1
"""m/s at which the robot drives back to where the line was."""
CATCH_SPEED = 0.03
"""m/s until it follows the edge that it found, which may lie across the way and is as wide as the sensor's
spot."""
ALL_BLACK_COVERAGE = 0.98
"""Share of the spot on black that counts as all of it, given noise."""
NEAR_M, NEAR_RAD = 1e-3, 0.02
"""m and rad within which a place and a heading count as reached."""
INTO_LIGHT_M, ASIDE_M = 0.03, 0.03
"""m to drive on into another light, and m by which the sensor then turns to both sides of the edge."""
LIGHT_SPEED, LIGHT_GAIN = 0.1, 3.0
"""Highest speed (m/s) and gain (rad/s per rad off the line's direction) on that way."""
OTHER_LIGHT_REASON = "it came into another light"


class LineSearch:
    """Searches for an edge of a line by turning on the spot, and records the readings of both surfaces
    meanwhile. Of two sensors the one on the side where the line was searches. velocity: m/s of the arriving
    robot."""

    def __init__(self, robot: Robot, sight: LineSight, line: LastEdge, velocity: float) -> None:
        self._robot, self._sight, self._line = robot, sight, line
        self._direction = line.direction or sight.direction
        self._sensor, self._edge_side = sight.edge(self._direction)
        self._line_heading, self._velocity = line.heading, velocity
        self._end = robot.time + SEARCH_TIME
        self._surfaces = [SurfaceLevels(each) for each in sight.sensors]
        self._reason = line.missed_for
        self._widest, self._speed, self._held_seconds = SEARCH_ANGLE, SEARCH_SPEED, 0.0
        self._came_along: list[Pose] = []  # the line up to the corner, while the robot searches over that

    def search_both_sides(self, *, again: bool = False) -> Steps[None]:
        """Search on both sides of the line's last place, then with the axle over that place. Ends on the
        edge, or on the line coming from beyond it. again: it was searched for here already, and what was
        found led nowhere, as the tip of a corner does; only the second search is new, if it is possible."""
        name, other = self._sight.name, self._line.other_tophat
        add_remark(self._robot, f"{name} lost the line: looking for it")
        if self._line.robot_heading is None and other:
            add_remark(
                self._robot, f"{name} found no edge, but {other} started on one: are their plugs exchanged?"
            )
        yield from self._stop()
        yield from self._wait_for_floor()
        first = self._direction or 1.0
        if not again or self._line.kept is None:
            yield from self._drive_back()
            for way in (first, -first):
                if (yield from self._turn(way)) or self._sensor.black:
                    return
            if self._learn_surfaces() and (yield from self._turn(first)):
                return
        yield from self._search_over_corner(first)

    def _search_over_corner(self, first: float) -> Steps[None]:
        """Drive until the axle is where the line was last followed, and turn there. The sensor then meets any
        line that begins there far from the corner, and across; one that turns back lies beyond the reach of a
        sensor that turns before the corner."""
        robot, corner = self._robot, self._line.kept
        if corner is None:
            self._give_up()
        self._end = robot.time + SEARCH_TIME
        self._widest, self._speed = CORNER_ANGLE, CORNER_SPEED
        self._came_along, here = [*self._line.trail, corner], robot.estimate
        x, y = corner.x - here.x, corner.y - here.y
        if (way := math.hypot(x, y)) > AT_CORNER_M:
            bearing = math.remainder(math.atan2(y, x) - here.heading, math.tau)
            ahead = 1.0 if abs(bearing) < 0.5 * math.pi else -1.0
            heading = here.heading + math.remainder(bearing if ahead > 0.0 else bearing + math.pi, math.tau)
            yield from self._turn_to(heading)
            yield from self._drive(robot.estimate.distance + ahead * way, lambda _: (heading, 0.0))
        for each in self._came_along:  # the last one that is far enough away
            if math.hypot(corner.x - each.x, corner.y - each.y) > CORNER_LEG_M:
                heading = math.atan2(corner.y - each.y, corner.x - each.x)
                self._line_heading += math.remainder(heading - self._line_heading, math.tau)
        oldest = Pose(self._came_along[0].x, self._came_along[0].y, self._line_heading)
        self._came_along += [oldest.ahead(-TRAIL_STEP_M * (k + 1)) for k in range(TRAIL_POSES)]
        for side in (first, -first):
            if (yield from self._turn(side)):
                return
        self._give_up()

    def learn_light(self) -> Steps[None]:
        """Drive on into the new light, turn over both surfaces there, the floor first, and back to the
        edge."""
        robot, sensor, self._reason = self._robot, self._sensor, OTHER_LIGHT_REASON
        add_remark(robot, f"{self._sight.name}: the light on the line has changed; learning it")
        begin, acceleration = robot.estimate.distance, robot.config.motion.acceleration
        speed = max(min(self._velocity, LIGHT_SPEED), CATCH_SPEED)  # after a search, or at first, it stands
        while robot.estimate.distance - begin < INTO_LIGHT_M and robot.time < self._end:
            self._velocity = limit_slew(self._velocity, speed, acceleration * robot.dt)
            robot.drive.follow(self._velocity, LIGHT_GAIN * (self._line_heading - robot.estimate.heading))
            yield
        yield from self._stop()
        yield from self._wait_for_floor()
        aside = ASIDE_M / sensor.config.forward
        yield from self._turn(self._edge_side, aside, to_edge=False)
        yield from self._turn(-self._edge_side, aside, to_edge=False)
        if not self._learn_surfaces():
            yield from self._turn(-self._edge_side, to_edge=False)
        yield from self._learn_and_return(self._edge_side)

    def _learn_surfaces(self) -> bool:
        learnt = [each.learn() for each in self._surfaces]  # every one
        return all(learnt)

    def _learn_and_return(self, way: float) -> Steps[None]:
        if not self._learn_surfaces() or not (yield from self._turn(way)):
            self._give_up()

    def _give_up(self) -> NoReturn:
        raise MotionTimeout(describe_lost_line(self._robot, self._sight, self._reason, self._widest))

    def _stop(self) -> Steps[None]:
        robot = self._robot
        while not is_at_rest(robot) and robot.time < self._end:
            self._velocity = limit_slew(self._velocity, 0.0, robot.config.motion.acceleration * robot.dt)
            robot.drive.follow(self._velocity)
            yield

    def _wait_for_floor(self) -> Steps[None]:
        """Stand until the sensors see a floor, without which no line can be found, and are known to be
        plugged in: the reading of an open port wanders through the edge of any line, but also at rest."""
        robot, begin, sensors = self._robot, self._robot.time, self._sight.sensors
        robot.drive.stop()
        while True:
            steady = [each.is_steady_at_rest() and each.sees for each in sensors]
            if all(steady) or robot.time - begin > SIGHT_TIME:
                break
            yield
        if blind := [each for each in sensors if each.floating or not each.sees]:
            raise MotionTimeout(
                f"{self._sight.name} lost the line: no floor is seen; {describe_obstacle(robot, *blind)}"
            )

    def _drive_back(self) -> Steps[None]:
        """Drive backwards along the arc that it came, to the last edge, or to black before that: a line that
        turned off is beside that place, not beside the place where it was missed."""
        line, here = self._line, self._robot.estimate
        heading = line.robot_heading
        if heading is None:
            return
        turned, way = here.heading - heading, here.distance - line.place
        if way > NEAR_M:
            bend = turned / way
            yield from self._drive(line.place, lambda left: (heading - bend * left, bend), to_black=True)

    def _drive(
        self, place: float, course: Callable[[float], tuple[float, float]], *, to_black: bool = False
    ) -> Steps[None]:
        """Drive to a place, m of the way, and stop. course: heading (rad) and bend (rad/m) with so many m
        left to it. to_black: stop where the sensor is over black."""
        robot, acceleration, stalled_seconds = self._robot, self._robot.config.motion.acceleration, 0.0
        way = math.copysign(1.0, place - robot.estimate.distance)
        while (left := place - robot.estimate.distance) * way > NEAR_M:
            if to_black and self._sensor.black:
                break
            stalled_seconds = stalled_seconds + robot.dt if robot.drive.wheels.stalled else 0.0
            if stalled_seconds > STALL_PATIENCE_S or robot.time > self._end:
                self._give_up()
            speed = min(BACK_SPEED, math.sqrt(acceleration * abs(left)))
            self._velocity = limit_slew(self._velocity, way * speed, acceleration * robot.dt)
            heading, bend = course(left)
            off = heading - robot.estimate.heading
            robot.drive.follow(self._velocity, self._velocity * bend + LIGHT_GAIN * off)
            yield
        yield from self._stop()

    def _turn_to(self, heading: float) -> Steps[None]:
        """Turn to a heading (rad) without looking for an edge, and stop."""
        robot, rate = self._robot, 0.0
        acceleration = robot.config.motion.turn_acceleration
        while abs(off := heading - robot.estimate.heading) > NEAR_RAD and robot.time < self._end:
            wanted = math.copysign(min(self._top_rate, math.sqrt(acceleration * abs(off))), off)
            rate = limit_slew(rate, wanted, acceleration * robot.dt)
            self._give_up_if_held()
            robot.drive.follow(0.0, rate)
            yield
        yield from self._stop()

    def _turn(self, direction: float, angle: float = math.inf, *, to_edge: bool = True) -> Steps[bool]:
        """Turn until `angle` rad beside the line's direction (at most as far as a line is searched for), or
        to the line's edge; returns whether it came to the edge. way: 1 to the left, -1 to the right."""
        robot, sensor = self._robot, self._sensor
        acceleration = robot.config.motion.turn_acceleration
        angle = min(angle, self._widest - direction * math.atan2(sensor.config.left, sensor.config.forward))
        rate = 0.0
        wanted_to_black = direction * self._edge_side < 0.0
        is_across = wanted_to_black  # who comes from the border of black may leave it there: by another edge
        sensor.forget_edge()
        while direction * (robot.estimate.heading - self._line_heading) < angle:
            for each in self._surfaces:
                each.read()
            # To the left of the left edge and to the right of the right one is white.
            edge = sensor.edge
            if to_edge and is_across and edge is not None and edge.to_black is wanted_to_black:
                if not self._leads_nowhere():
                    return True
                sensor.forget_edge()
            if not is_across and (sensor.coverage or 0.0) > ALL_BLACK_COVERAGE:
                is_across = True
                sensor.forget_edge()
            self._give_up_if_held()
            if robot.paused:
                rate = robot.estimate.turn_rate
            rate = limit_slew(rate, direction * self._top_rate, acceleration * robot.dt)
            robot.drive.follow(0.0, rate)
            yield
        return False

    @property
    def _top_rate(self) -> float:
        """rad/s of a search on the spot."""
        wanted = min(self._robot.config.motion.turn_rate, self._speed / self._sensor.config.forward)
        return self._robot.drive.speeds.planned_turn(wanted, self._robot.config.motion.turn_acceleration)[0]

    def _leads_nowhere(self) -> bool:
        """Whether the sensor, over the corner, is on its tip or on the line along which the robot came."""
        if not self._came_along:
            return False
        config, (x, y) = self._sensor.config, sensor_place(self._robot, self._sensor)
        bearing = self._robot.estimate.heading + math.atan2(config.left, config.forward) - self._line_heading
        near = 0.5 * TAPE_WIDTH_M + TAPE_MARGIN_M
        return abs(math.remainder(bearing, math.tau)) < TIP_ANGLE or any(
            math.hypot(x - each.x, y - each.y) < near for each in self._came_along
        )

    def _give_up_if_held(self) -> None:
        """Give up a robot that has not turned for a while, or has searched for too long."""
        robot = self._robot
        is_held = robot.drive.wheels.stalled or robot.odometry.wiring.suspects
        self._held_seconds = self._held_seconds + robot.dt if is_held else 0.0
        if self._held_seconds > STALL_PATIENCE_S or robot.time > self._end:
            self._give_up()


def describe_lost_line(robot: Robot, sight: LineSight, why: str, angle: float = SEARCH_ANGLE) -> str:
    """The message when the line is given up. why: the reason for the search. angle: rad to either side in
    which it was searched for."""
    return (
        f"{sight.name} lost the line: {why}, and no line was found within {math.degrees(angle):.0f} "
        f"degrees to either side; {describe_obstacle(robot, *sight.sensors)}"
    )
