"""Searching for a line on the spot, for a robot that slid off it or whose light changed."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NoReturn

from raccoon.control.motion import limit_slew
from raccoon.core.errors import MotionTimeout
from raccoon.robot.actions.actions import Steps
from raccoon.robot.motions.last_edge import LastEdge
from raccoon.robot.motions.pacing import STALL_PATIENCE_S, describe_obstacle, is_at_rest
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.robot.motions.line_sight import LineSight
    from raccoon.robot.parts.tophats import TophatSensor
    from raccoon.robot.robot import Robot

SEARCH_ANGLE = math.radians(90.0)
"""rad to either side of the line's direction in which it is searched for, measured at the sensor about the
middle of the axle: a sensor mounted to one side would otherwise search less far on the other side."""
SEARCH_SPEED, SEARCH_TIME = 0.08, 12.0
"""m/s of the sensor while searching, and longest duration of a search, s."""
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
NEAR_M = 1e-3
"""m within which a place counts as reached."""
INTO_LIGHT_M, ASIDE_M = 0.03, 0.03
"""m to drive on into another light, and m by which the sensor then turns to both sides of the edge."""
LIGHT_SPEED, LIGHT_GAIN = 0.1, 3.0
"""Highest speed (m/s) and gain (rad/s per rad off the line's direction) on that way."""
OTHER_LIGHT_REASON = "it came into another light"
SURFACE_READINGS = 4
"""Consecutive readings whose mean is a surface's reading."""


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
        self._surfaces = [_SurfaceLevels(each) for each in sight.sensors]
        self._reason = line.missed_for

    def search_both_sides(self) -> Steps[None]:
        """Search on both sides of the line's last place. Ends on the edge, or on the line coming from beyond
        it."""
        name, other = self._sight.name, self._line.other_tophat
        add_remark(self._robot, f"{name} lost the line: looking for it")
        if self._line.robot_heading is None and other:
            add_remark(
                self._robot, f"{name} found no edge, but {other} started on one: are their plugs exchanged?"
            )
        yield from self._stop()
        yield from self._wait_for_floor()
        yield from self._drive_back()
        first = self._direction or 1.0
        for way in (first, -first):
            if (yield from self._turn(way)) or self._sensor.black:
                return
        yield from self._learn_and_return(first)

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
        raise MotionTimeout(describe_lost_line(self._robot, self._sight, self._reason))

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
        robot, line, acceleration = self._robot, self._line, self._robot.config.motion.acceleration
        if line.robot_heading is None:
            return
        bend = robot.estimate.heading - line.robot_heading
        way, stalled_seconds = robot.estimate.distance - line.place, 0.0
        while (left := robot.estimate.distance - line.place) > NEAR_M and not self._sensor.black:
            stalled_seconds = stalled_seconds + robot.dt if robot.drive.wheels.stalled else 0.0
            if stalled_seconds > STALL_PATIENCE_S or robot.time > self._end:
                self._give_up()
            speed = min(BACK_SPEED, math.sqrt(acceleration * left))
            self._velocity = limit_slew(self._velocity, -speed, acceleration * robot.dt)
            off = line.robot_heading + bend * left / way - robot.estimate.heading
            robot.drive.follow(self._velocity, self._velocity * bend / way + LIGHT_GAIN * off)
            yield
        yield from self._stop()

    def _turn(self, direction: float, angle: float = math.inf, *, to_edge: bool = True) -> Steps[bool]:
        """Turn until `angle` rad beside the line's direction (at most as far as a line is searched for), or
        to the line's edge; returns whether it came to the edge. way: 1 to the left, -1 to the right."""
        robot, sensor, motion = self._robot, self._sensor, self._robot.config.motion
        angle = min(angle, SEARCH_ANGLE - direction * math.atan2(sensor.config.left, sensor.config.forward))
        wanted = min(motion.turn_rate, SEARCH_SPEED / sensor.config.forward)
        top, acceleration = robot.drive.speeds.planned_turn(wanted, motion.turn_acceleration)
        rate = held_seconds = 0.0
        wanted_to_black = direction * self._edge_side < 0.0
        is_across = wanted_to_black  # who comes from the border of black may leave it there: by another edge
        sensor.forget_edge()
        while direction * (robot.estimate.heading - self._line_heading) < angle:
            for each in self._surfaces:
                each.read()
            # To the left of the left edge and to the right of the right one is white.
            edge = sensor.edge
            if to_edge and is_across and edge is not None and edge.to_black is wanted_to_black:
                return True
            if not is_across and (sensor.coverage or 0.0) > ALL_BLACK_COVERAGE:
                is_across = True
                sensor.forget_edge()
            is_held = robot.drive.wheels.stalled or robot.odometry.wiring.suspects
            held_seconds = held_seconds + robot.dt if is_held else 0.0
            if held_seconds > STALL_PATIENCE_S or robot.time > self._end:
                self._give_up()
            if robot.paused:
                rate = robot.estimate.turn_rate
            rate = limit_slew(rate, direction * top, acceleration * robot.dt)
            robot.drive.follow(0.0, rate)
            yield
        return False


class _SurfaceLevels:
    """The lowest and the highest mean that a sensor read: floor and line, if it went over both."""

    def __init__(self, sensor: TophatSensor) -> None:
        self._sensor = sensor
        self._last_counts: deque[float] = deque(maxlen=SURFACE_READINGS)
        self._white, self._black = math.inf, -math.inf

    def read(self) -> None:
        """Take the reading of this cycle."""
        last, counts = self._last_counts, self._sensor.counts
        if counts is not None and self._sensor.sees:
            last.append(counts)
        if len(last) == SURFACE_READINGS:
            mean = sum(last) / SURFACE_READINGS
            self._white, self._black = min(self._white, mean), max(self._black, mean)

    def learn(self) -> bool:
        """Let the sensor take them over; returns whether it did, which it does if they are two surfaces."""
        return self._sensor.relearn(self._white, self._black)


def describe_lost_line(robot: Robot, sight: LineSight, why: str) -> str:
    """The message when the line is given up. why: the reason for the search."""
    return (
        f"{sight.name} lost the line: {why}, and no line was found within {math.degrees(SEARCH_ANGLE):.0f} "
        f"degrees to either side; {describe_obstacle(robot, *sight.sensors)}"
    )
