"""Motions to places of the field: drive to a pose, follow a path.

Places are in the field frame: x ahead of where the robot started, y to its left (docs/quantities.md). As in
goals.py, each takes `tolerance` and `timeout`, returns a MotionResult and raises MotionTimeout.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import dropwhile
from typing import TYPE_CHECKING

from raccoon.control.motion import line_command
from raccoon.control.path import Path, Point, drop_repeated_points, split_at_reversals
from raccoon.control.stages import Stage, StagedProfile
from raccoon.model.pose import Pose
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import (
    check_heading,
    check_number,
    check_pace,
    check_positive,
    check_times,
    check_tolerance,
    check_way,
)
from raccoon.robot.motions.goals import shorter_way, straight, turn_steps
from raccoon.robot.motions.pacing import LAG_LIMIT, MotionResult, Pace, finish_motion

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

# Nearer than this the way to the place has no direction worth turning to.
HERE_M = 0.005


def drive_to(
    x: float,
    y: float,
    heading: float | None = None,
    speed: float | None = None,
    *,
    backwards: bool = False,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Drive to the place (x, y) m of the field: turn towards it, drive straight, turn to `heading` rad.

    heading: None keeps the heading of arrival. backwards: drive with the back first. speed: m/s on the way.
    tolerance: m, of the straight part. timeout: s, of each of the three parts. The result is relative to the
    requested pose.
    """
    check_way(x=x, y=y)
    check_heading(heading=0.0 if heading is None else heading)
    check_pace("backwards=True drives backwards", speed=speed)
    check_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)
    x, y = float(x), float(y)

    def steps(robot: Robot) -> Steps[MotionResult]:
        begin = robot.time
        start = robot.plan
        distance = math.hypot(x - start.x, y - start.y)
        parts: list[MotionResult] = []
        if distance > HERE_M:
            bearing = math.atan2(y - start.y, x - start.x) + (math.pi if backwards else 0.0)
            angle = shorter_way(bearing - start.heading)
            parts.append((yield from turn_steps(robot, angle, timeout=timeout)))
            way = straight(-distance if backwards else distance, speed, tolerance=tolerance, timeout=timeout)
            parts.append((yield from way.start(robot)))
        if heading is not None:
            angle = heading - robot.plan.heading
            parts.append((yield from turn_steps(robot, shorter_way(angle, angle), timeout=timeout)))
        return _combined_result(robot, Pose(x, y, robot.plan.heading), begin, parts)

    return Action(f"drive to ({x:g}, {y:g})", steps)


def _combined_result(robot: Robot, goal: Pose, begin: float, parts: list[MotionResult]) -> MotionResult:
    """The combined result of several motions, relative to their common goal."""
    here = robot.estimate
    along, across = goal.offset_of(here.x, here.y)
    return MotionResult(
        along,
        across,
        here.heading - goal.heading,
        robot.time - begin,
        math.hypot(here.x_std, here.y_std),
        any(each.saturated for each in parts),
        here.heading_std,
        max((each.missing_speed for each in parts), default=0.0),
        min((each.planned for each in parts), default=1.0),
        tuple(dict.fromkeys(said for each in parts for said in each.remarks)),
        sum(each.held for each in parts),
    )


def follow_path(
    points: Sequence[Point],
    speed: float | None = None,
    *,
    rounding: float = 0.10,
    backwards: bool = False,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Drive through `points`, (x, y) m of the field, without stopping, from the robot's place.

    The first leg leads to the first point that is not the robot's own place; the robot first turns on the
    spot if that lies to a side. If the following points lead back to where it came from, it stops at that
    first point and turns there as well. rounding: m, radius of the arcs that round the corners. backwards:
    drive with the back first. speed: m/s of the faster wheel, so corners are slower than straights.
    tolerance: m along the path at its end. timeout: s, of each stretch without a stop, and of each turn.
    Raises ValueError for points that do not form a path, such as some that turn back.
    """
    check_pace(speed=speed)
    check_positive("rounding", rounding)
    check_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)
    _check_points(points)
    points = [(float(x), float(y)) for x, y in points]
    if len(drop_repeated_points(points)) > 1:
        Path(points, rounding)  # what is wrong with the points is said before anything moves
    for number, (x, y) in enumerate(points):
        check_way(**{f"x of points[{number}]": x, f"y of points[{number}]": y})

    flipped = math.pi if backwards else 0.0

    def steps(robot: Robot) -> Steps[MotionResult]:
        begin, here = robot.time, robot.plan
        ahead = list(dropwhile(lambda point: math.dist(point, (here.x, here.y)) <= HERE_M, points))
        if not ahead:
            x, y = points[-1]
            return _combined_result(robot, Pose(x, y, here.heading), begin, [])
        parts: list[MotionResult] = []
        # Where the robot is, and so the corner at the first point, is not known before.
        for leg in split_at_reversals([(here.x, here.y), *ahead]):
            path = Path(leg, rounding)
            angle = shorter_way(path.start.heading + flipped - robot.plan.heading)
            if abs(angle) > robot.config.motion.heading_tolerance:
                parts.append((yield from turn_steps(robot, angle, timeout=timeout)))
            parts.append((yield from _follow_steps(robot, path, speed, tolerance, timeout, flipped)))
        return parts[0] if len(parts) == 1 else _combined_result(robot, robot.plan, begin, parts)

    return Action(f"follow a path of {len(points)} points", steps)


def _check_points(points: Sequence[Point]) -> None:
    """Raise ValueError if there are no points, TypeError for anything that is not a point or not a list of
    them."""
    if not hasattr(points, "__getitem__"):  # a set has no order
        raise TypeError(f"points is {points!r}: it must be a list of (x, y), m of the field")
    if len(points) == 0:
        raise ValueError("points is empty: a path needs at least 1 point")
    for number, point in enumerate(points):
        try:
            x, y = point
        except (TypeError, ValueError):
            raise TypeError(f"points[{number}] is {point!r}: it must be (x, y), m of the field") from None
        check_number(f"x of points[{number}]", x, "m of the field")
        check_number(f"y of points[{number}]", y, "m of the field")


def _follow_steps(
    robot: Robot,
    path: Path,
    speed: float | None,
    tolerance: float | None,
    timeout: float | None,
    flipped: float,
) -> Steps[MotionResult]:
    """The steps along a path. flipped: rad from the path's direction to the robot's heading, pi if it drives
    backwards; the control law holds for its rear end alike."""
    motion = robot.config.motion
    turns = round((robot.plan.heading - path.start.heading - flipped) / math.tau) * math.tau + flipped
    ahead = -1.0 if flipped else 1.0
    stages, planned = [], math.inf
    for piece in path.pieces:
        outer = 1.0 + robot.drive.half_track * abs(piece.curvature)
        wanted = (motion.speed if speed is None else float(speed)) / outer
        top, acceleration = robot.drive.speeds.planned(wanted, motion.acceleration, outer)
        stages.append(Stage(piece.length, top, acceleration))
        planned = min(planned, top / wanted)
    pace = Pace(robot, StagedProfile(stages, motion.jerk), LAG_LIMIT, timeout, planned, "path")
    progress = [0.0]

    def place(way: float) -> Pose:
        pose = path.at(way).pose
        return Pose(pose.x, pose.y, pose.heading + turns)

    for state in pace.states(lambda: progress[0], place):
        here = robot.estimate
        along = progress[0] = path.nearest(here.x, here.y, progress[0])
        at = path.at(along)
        _, across = at.pose.offset_of(here.x, here.y)
        if pace.may_end(path.length - along, tolerance):
            break
        off = math.remainder(here.heading - flipped - at.pose.heading, math.tau)
        velocity, turn_rate = line_command(state, along, across, off)
        robot.drive.follow(ahead * velocity, turn_rate + velocity * at.curvature, ahead * state.acceleration)
        yield
    return finish_motion(robot, place(path.length), pace)
