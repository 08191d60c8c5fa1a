"""Motions relative to lines on the table: align on one."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

from raccoon.core.errors import ConfigError, MotionTimeout
from raccoon.model.pose import Pose
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import (
    check_angle,
    check_heading_tolerance,
    check_limits,
    check_name,
    check_speed,
    check_times,
    check_way,
)
from raccoon.robot.actions.steps import advance
from raccoon.robot.motions.driving import drive_until_stopped
from raccoon.robot.motions.goals import turn_steps
from raccoon.robot.motions.pacing import MotionResult, describe_obstacle, wall_hint
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.robot.parts.tophats import TophatSensor
    from raccoon.robot.robot import Robot

MIN_REACH = 0.02
MAX_SQUINT, WAY_MARGIN_M = math.radians(80.0), 0.02
"""rad of squint beyond which the way between two meetings is no longer bounded more tightly; m that it may be
longer, for the width of a spot and for a robot that turns on its way."""
MAX_REGULAR_ANGLE, MAX_ALONG_ANGLE = math.radians(4.0), math.radians(1.5)
"""rad from a multiple of a quarter turn of the field, of a line that is laid regularly; rad of a line along
the field."""


class _Meeting(NamedTuple):
    """Where a sensor met an edge: place on the field (x, y, m), and m that the robot had driven."""

    place: tuple[float, float]
    way: float


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
    reach: m in which to find the line. squint: rad, largest angle of the line to the robot. tolerance (rad)
    and timeout (s) are those of the turn and of the drive before it, as for `turn` and `straight`.

    The places where the two sensors met the same edge give the line's direction: the edge on which both came
    to black, or, if one stood on the line already, the one on which both left it. The result's heading is the
    robot's relative to the line's normal. Raises MotionTimeout if there is no line within reach or a wheel
    does not turn, CalibrationError without calibrations.
    """
    check_name(left=left, right=right)
    check_speed(speed=speed)
    check_limits(reach=reach, squint=squint)
    check_heading_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)
    check_way(reach=reach)
    check_angle(1.0, "", squint=squint)
    if speed == 0.0:
        raise ValueError("speed is 0: allowed are numbers above or below it")

    def steps(robot: Robot) -> Steps[MotionResult]:
        begin = robot.time
        first = yield from _meet_edges(robot, left, right, speed, reach, timeout, squint)
        (x0, y0), (x1, y1) = first
        # From the right sensor's point to the left one's is the line; its normal to the right looks ahead.
        normal = math.atan2(y0 - y1, x0 - x1) - 0.5 * math.pi
        here = robot.estimate.heading
        angle = math.remainder(normal - here, math.tau)
        if abs(angle) > squint:
            raise MotionTimeout(
                f"the line lies {math.degrees(angle):.0f} deg askew: allowed are {math.degrees(squint):.0f}"
            )
        said = _remark_exchanged(robot, left, right, angle)
        robot.replan()
        turned = yield from turn_steps(robot, angle, None, tolerance, timeout)
        goal = Pose(robot.estimate.x, robot.estimate.y, here + angle)
        robot.plan = goal
        off = robot.estimate.heading - goal.heading
        took, std = robot.time - begin, turned.heading_std
        return MotionResult(
            0.0, 0.0, off, took, turned.std, turned.saturated, std, remarks=(*turned.remarks, *said)
        )

    return Action(
        f"align on a line with {left} and {right}", steps, lambda robot: check_sides(robot, left, right)
    )


def _meet_edges(
    robot: Robot,
    left: str,
    right: str,
    speed: float | None,
    reach: float,
    timeout: float | None,
    squint: float,
) -> Steps[tuple[tuple[float, float], tuple[float, float]]]:
    """Drive until both sensors have met the same edge; the places on the field where each did, left first."""
    sensors = robot.tophat(left), robot.tophat(right)
    for sensor in sensors:
        sensor.require()
        sensor.forget_edge()
    body = drive_until_stopped(
        0.5 * robot.config.motion.speed if speed is None else speed, reach, timeout
    ).start(robot)
    max_way = _max_way_between(*sensors, squint)
    # A line has two edges, and a sensor that stands on it meets but the second: only places on the same one
    # give its direction. By whether the edge leads to black: where the left and the right sensor met it.
    met: dict[bool, list[_Meeting | None]] = {True: [None, None], False: [None, None]}
    try:
        while True:
            for index, sensor in enumerate(sensors):
                edge = sensor.edge
                if edge is None:
                    continue
                sensor.forget_edge()
                now = _Meeting(sensor_place(robot, sensor, robot.time - edge.time), robot.estimate.distance)
                places, other = met[edge.to_black], met[edge.to_black][1 - index]
                if other is not None and abs(now.way - other.way) < max_way:
                    return (other.place, now.place) if index else (now.place, other.place)
                mine = places[index]
                if mine is None or abs(now.way - mine.way) > max_way:
                    places[index] = now
            try:
                advance(body)
            except StopIteration as end:
                raise MotionTimeout(
                    _describe_no_line(robot, left, right, met.values(), reach, end.value)
                ) from None
            yield
    finally:
        body.close()


def _max_way_between(left: TophatSensor, right: TophatSensor, squint: float) -> float:
    """m of way between the two sensors' meetings with one edge, at the most: what a sensor met before that
    was another edge, as that of the line along which the robot came."""
    aside = abs(left.config.left - right.config.left) * math.tan(min(squint, MAX_SQUINT))
    return aside + abs(left.config.forward - right.config.forward) + WAY_MARGIN_M


def _describe_no_line(
    robot: Robot,
    left: str,
    right: str,
    met: Iterable[list[_Meeting | None]],
    reach: float,
    held: float,
) -> str:
    """Which sensors did not meet the edge that both came nearest to meeting, and possible reasons."""
    places = max(met, key=lambda each: sum(place is not None for place in each))
    names = [name for name, place in zip((left, right), places, strict=True) if place is None]
    why = describe_obstacle(robot, *map(robot.tophat, names))
    found = ""
    if len(names) == 1:
        met_by = right if names[0] == left else left
        found = f", but one at {met_by}: does it lie on that side only, as at a junction?"
    return f"no line at {' and '.join(names)} within {reach:g} m{found}; {why}{wall_hint(held, 'it')}"


def sensor_place(robot: Robot, sensor: TophatSensor, ago: float = 0.0) -> tuple[float, float]:
    """The place of a sensor on the field `ago` s before now."""
    here = robot.estimate
    pose = Pose(here.x, here.y, here.heading).ahead(-here.velocity * ago)
    ahead = pose.ahead(sensor.config.forward)
    side = sensor.config.left
    return ahead.x - side * math.sin(ahead.heading), ahead.y + side * math.cos(ahead.heading)


def _remark_exchanged(robot: Robot, left: str, right: str, angle: float) -> tuple[str, ...]:
    """A remark if a line, `angle` rad askew, lies regularly on the field only if the plugs of the two sensors
    are exchanged."""
    here = robot.estimate
    normals = here.heading + angle, here.heading - angle
    lies, mirrored = (abs(math.remainder(each, 0.5 * math.pi)) for each in normals)
    if (
        lies < MAX_REGULAR_ANGLE
        or mirrored > MAX_ALONG_ANGLE
        or abs(angle) < MAX_REGULAR_ANGLE
        or here.heading_std > MAX_ALONG_ANGLE
    ):
        return ()
    said = (
        f"as {left} and {right} see it, the line lies {math.degrees(lies):.0f} deg askew in the field, but "
        "parallel to its sides if their plugs are exchanged: are they?"
    )
    add_remark(robot, said)
    return (said,)


def check_sides(robot: Robot, left: str, right: str) -> None:
    """Raise ConfigError if robot.toml lacks one of the tophats, or has left and right exchanged."""
    if robot.tophat(left).config.left <= robot.tophat(right).config.left:
        raise ConfigError(f"tophat {left} is not to the left of {right} in robot.toml")


def tophat_ahead(robot: Robot, name: str) -> TophatSensor:
    """A tophat that can follow a line. Raises ConfigError if it is not ahead of the axle."""
    sensor = robot.tophat(name)
    if sensor.config.forward < MIN_REACH:
        raise ConfigError(
            f"tophat.{name}.forward = {sensor.config.forward}: to follow a line it must sit at least "
            f"{MIN_REACH} m ahead of the axis"
        )
    return sensor
