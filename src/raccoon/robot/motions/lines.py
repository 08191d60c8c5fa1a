"""Motions that go by what is on the table: align on a line, align against a wall."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from raccoon.core.errors import ConfigError, MotionTimeout
from raccoon.model.pose import Pose
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import (
    check_angle,
    check_finite,
    check_heading,
    check_limit,
    check_limits,
    check_name,
    check_near_heading,
    check_positive,
    check_speed,
    check_times,
    check_way,
)
from raccoon.robot.actions.steps import advance
from raccoon.robot.motions.driving import search
from raccoon.robot.motions.goals import turning
from raccoon.robot.motions.pacing import MotionResult, at_a_wall, reason
from raccoon.robot.remarks import STANDS, say

if TYPE_CHECKING:
    from raccoon.robot.parts.tophats import TophatSensor
    from raccoon.robot.robot import Robot

LEAST_REACH = 0.02
WALL_SPEED_SHARE = 0.2
WALL_TIME = 0.3
PRESS_FORCE = 8.0
"""N a wheel, against a wall: tyres of 0.9 under half of 3 kg carry 13 N."""
ODDLY, ALONG = math.radians(4.0), math.radians(1.5)
"""rad from a quarter of a turn of the field: of a line that is laid so, and of one along the field."""
SLOWED_SHARE, SQUARING_SHARE = 0.9, 0.15
"""Of the fastest speed on the way: slower wheels are at a wall; wheels that differ by twice that turn it."""


def align_on_line(
    left: str,
    right: str,
    speed: float | None = None,
    *,
    reach: float = 0.5,
    squint: float = math.radians(60.0),
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Drive over an edge of a line with two tophats, then turn square to it.

    left, right: names of the tophats. speed: m/s, negative backwards; half of `motion.speed` when None.
    reach: m to look for the line. squint: rad, the most that the line may lie askew. tolerance: rad, and
    timeout: s, of the turn and of the drive before it, as `turn` and `straight` have them. Where each sensor
    met the edge tells the line's direction: the edge on which both came to black, or, where one stood on the
    line already, the one on which both left it. The result's heading is the robot's against the line's
    normal. Raises MotionTimeout where there is no line within reach or a wheel does not turn,
    CalibrationError without calibrations.
    """
    check_name(left=left, right=right)
    check_speed(speed=speed)
    check_limits(reach=reach, squint=squint)
    check_near_heading(tolerance=tolerance)
    check_times(timeout=timeout)
    check_way(reach=reach)
    check_angle(1.0, "", squint=squint)
    if speed == 0.0:
        raise ValueError("speed is 0: allowed are numbers above or below it")

    def steps(robot: Robot) -> Steps[MotionResult]:
        begin = robot.time
        first = yield from _edges(robot, left, right, speed, reach, timeout)
        (x0, y0), (x1, y1) = first
        # From the right sensor's point to the left one's is the line; its normal to the right looks ahead.
        normal = math.atan2(y0 - y1, x0 - x1) - 0.5 * math.pi
        here = robot.estimate.heading
        angle = math.remainder(normal - here, math.tau)
        if abs(angle) > squint:
            raise MotionTimeout(
                f"the line lies {math.degrees(angle):.0f} deg askew: allowed are {math.degrees(squint):.0f}"
            )
        said = _exchanged(robot, left, right, angle)
        robot.replan()
        turned = yield from turning(robot, angle, None, tolerance, timeout)
        goal = Pose(robot.estimate.x, robot.estimate.y, here + angle)
        robot.plan = goal
        off = robot.estimate.heading - goal.heading
        took, std = robot.time - begin, turned.heading_std
        return MotionResult(
            0.0, 0.0, off, took, turned.std, turned.saturated, std, remarks=(*turned.remarks, *said)
        )

    return Action(
        f"align on a line with {left} and {right}", steps, lambda robot: _check_sides(robot, left, right)
    )


def _edges(
    robot: Robot, left: str, right: str, speed: float | None, reach: float, timeout: float | None
) -> Steps[tuple[tuple[float, float], tuple[float, float]]]:
    """Drive until both sensors have met the same edge; where on the field each did, left first."""
    sensors = robot.tophat(left), robot.tophat(right)
    for sensor in sensors:
        sensor.require()
        sensor.forget_edge()
    body = search(0.5 * robot.config.motion.speed if speed is None else speed, reach, timeout).start(robot)
    # A line has two edges, and a sensor that stands on it meets but the second: only places on the same one
    # give its direction. By whether the edge leads to black: where the left and the right sensor met it.
    met: dict[bool, list[tuple[float, float] | None]] = {True: [None, None], False: [None, None]}
    try:
        while True:
            for index, sensor in enumerate(sensors):
                edge = sensor.edge
                if edge is None:
                    continue
                sensor.forget_edge()
                places = met[edge.to_black]
                if places[index] is None:
                    places[index] = _place(robot, sensor, robot.time - edge.time)
                if places[0] is not None and places[1] is not None:
                    return places[0], places[1]
            try:
                advance(body)
            except StopIteration as end:
                raise MotionTimeout(_no_line(robot, left, right, met.values(), reach, end.value)) from None
            yield
    finally:
        body.close()


def _no_line(
    robot: Robot,
    left: str,
    right: str,
    met: Iterable[list[tuple[float, float] | None]],
    reach: float,
    held: float,
) -> str:
    """Which sensors lack the edge that they were nearest to having both met, and why that may be."""
    places = max(met, key=lambda each: sum(place is not None for place in each))
    names = [name for name, place in zip((left, right), places, strict=True) if place is None]
    why = reason(robot, *map(robot.tophat, names))
    return f"no line at {' and '.join(names)} within {reach:g} m; {why}{at_a_wall(held, 'it')}"


def _place(robot: Robot, sensor: TophatSensor, ago: float) -> tuple[float, float]:
    """Where on the field a sensor was `ago` s before now."""
    here = robot.estimate
    pose = Pose(here.x, here.y, here.heading).ahead(-here.velocity * ago)
    ahead = pose.ahead(sensor.config.forward)
    side = sensor.config.left
    return ahead.x - side * math.sin(ahead.heading), ahead.y + side * math.cos(ahead.heading)


def _exchanged(robot: Robot, left: str, right: str, angle: float) -> tuple[str, ...]:
    """What to say where a line, `angle` rad askew, lies along the field as lines do if the plugs of the two
    sensors are exchanged, and oddly if they are not."""
    here = robot.estimate
    normals = here.heading + angle, here.heading - angle
    lies, mirrored = (abs(math.remainder(each, 0.5 * math.pi)) for each in normals)
    if lies < ODDLY or mirrored > ALONG or abs(angle) < ODDLY or here.heading_std > ALONG:
        return ()
    said = (
        f"by {left} and {right} the line lies {math.degrees(lies):.0f} deg askew in the field, and along it "
        "if their plugs are exchanged: are they?"
    )
    say(robot, said)
    return (said,)


def align_on_wall(
    speed: float = 0.06,
    *,
    heading: float | None = None,
    heading_std: float = math.radians(1.0),
    timeout: float = 5.0,
) -> Action[MotionResult]:
    """Push against a wall until both wheels stand, so that the robot is square to it.

    speed: m/s at which it comes, negative backwards. It presses with no more than 8 N a wheel (by the motors'
    models): at full voltage most motors are stronger than the grip, and the wheels would spin for ever.
    heading: rad of the field that the robot then has, where that is known: the odometry takes it, with
    `heading_std` rad, or says that it is too far off to be believed (`remarks` of the result). Raises
    MotionTimeout where the wheels still turn after `timeout` s: there is no wall, or they spin at it.
    """
    check_speed(speed=speed)
    check_finite(speed=speed)  # None is no default here
    check_heading(heading=0.0 if heading is None else heading)
    check_positive("heading_std", heading_std)
    check_near_heading(heading_std=heading_std)
    check_limit(timeout=timeout)
    if speed == 0.0:
        raise ValueError("speed is 0: allowed are numbers above or below it")

    def steps(robot: Robot) -> Steps[MotionResult]:
        begin, before, quiet = robot.time, robot.estimate.distance, 0.0
        wheel_speed = robot.drive.wheel_speed(speed)
        at_wall = _AtWall(robot.drive.half_track)
        try:
            while quiet < WALL_TIME:
                if robot.time - begin > timeout:
                    way = abs(robot.estimate.distance - before)
                    raise MotionTimeout(f"no wall after {timeout:g} s: {_why_no_wall(robot, way)}")
                here = robot.estimate
                turns = max(abs(here.left_speed), abs(here.right_speed)) > WALL_SPEED_SHARE * abs(wheel_speed)
                started = robot.time - begin > WALL_TIME
                unread = any(robot.odometry.silent_wheels)  # they say nothing, not that they stand
                quiet = 0.0 if turns or unread or not started else quiet + robot.dt
                at_wall.update(here.velocity, here.turn_rate, robot.dt, started)
                # At first all of it: a robot that stands sticks.
                force = PRESS_FORCE if started else math.inf
                turning_at = here.left_speed, here.right_speed
                robot.drive.push(speed, robot.battery_voltage, turning_at, force)
                yield
        finally:
            robot.drive.stop()
            robot.odometry.doubt_way(at_wall.way)
            robot.replan()
        off = 0.0
        said: tuple[str, ...] = ()
        if heading is not None:
            off = math.remainder(robot.estimate.heading - heading, math.tau)
            said = _observed_wall(robot, off, heading, heading_std)
        here = robot.estimate
        robot.plan = Pose(here.x, here.y, here.heading)
        std = math.hypot(here.x_std, here.y_std)
        return MotionResult(0.0, 0.0, off, robot.time - begin, std, False, here.heading_std, remarks=said)

    return Action("align on a wall", steps)


def _why_no_wall(robot: Robot, way: float) -> str:
    """What the wheels do where they do not both stand. way: m that they turned."""
    here, drive = robot.estimate, robot.config.drive
    if any(robot.odometry.silent_wheels):  # what they do is a guess
        return "; ".join(here.reasons)
    for side, port, speed, other in (
        ("left", drive.left, here.left_speed, here.right_speed),
        ("right", drive.right, here.right_speed, here.left_speed),
    ):
        if abs(speed) < STANDS < abs(other):
            return f"the {side} wheel alone stands (motor port {port}): blocked, unplugged or a fuse"
    on_the_way = f"after {way:.2f} m, on the way (a longer timeout= gets there)"
    return f"the wheels still turn {on_the_way} or spinning at it"


class _AtWall:
    """Adds up in `way`, m, what the wheels turn from where the wall slows them until they stand: tyres slip
    while they press, so the robot may have stood. Where it turns it rolls, and comes to the wall.
    """

    def __init__(self, half_track: float) -> None:
        self.way = 0.0
        self._half_track, self._fastest = half_track, 0.0

    def update(self, velocity: float, turn_rate: float, dt: float, started: bool) -> None:
        """Take a cycle: m/s, rad/s and s. started: it has had its time to come to its speed."""
        speed = abs(velocity)
        self._fastest = max(self._fastest, speed)
        squares_up = abs(turn_rate) * self._half_track > SQUARING_SHARE * self._fastest
        if started and speed < SLOWED_SHARE * self._fastest and not squares_up:
            self.way += speed * dt


def _observed_wall(robot: Robot, off: float, heading: float, std: float) -> tuple[str, ...]:
    """Give the odometry the heading of a wall, from which it is `off` rad; what is to be said of that."""
    found = robot.odometry.observe_heading(heading, std)
    if found.accepted:
        return ()
    remark = (
        f"align_on_wall: heading={math.degrees(heading):.1f} deg is not taken, the odometry is "
        f"{math.degrees(off):.1f} deg from it: {found.reason}; it is no such wall, the gyro's scale is "
        "another one (ten turns by hand tell), or the robot was moved or pushed (robot.odometry.reset says "
        "where it is)"
    )
    say(robot, remark)
    return (remark,)


def _check_sides(robot: Robot, left: str, right: str) -> None:
    """Raise ConfigError where robot.toml lacks one of the tophats, or has them the other way round."""
    if robot.tophat(left).config.left <= robot.tophat(right).config.left:
        raise ConfigError(f"tophat {left} is not to the left of {right} in robot.toml")


def tophat_ahead(robot: Robot, name: str) -> TophatSensor:
    """A tophat that can follow a line. Raises ConfigError where it does not sit ahead of the axis."""
    sensor = robot.tophat(name)
    if sensor.config.forward < LEAST_REACH:
        raise ConfigError(
            f"tophat.{name}.forward = {sensor.config.forward}: to follow a line it must sit at least "
            f"{LEAST_REACH} m ahead of the axis"
        )
    return sensor
