"""Motions to a goal: straight, turn, arc and pivot, each an action that keeps to its path.

Each motion starts from where the previous one was meant to end (`robot.plan`), not from where it did end, so
a small error is corrected by the next motion instead of adding to it.

Every motion to a goal takes `tolerance` (how near the goal it may end; robot.toml's `[motion]` when None) and
`timeout` (s; twice its profile and 2 s when None), returns a `MotionResult`, and raises MotionTimeout if it
cannot arrive, with the reason: stalled (with the motor port), saturated (with the missing speed), slipping.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from raccoon.control.motion import line_command, turn_command
from raccoon.control.profile import profile
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import (
    check_angle,
    check_heading,
    check_heading_tolerance,
    check_pace,
    check_times,
    check_tolerance,
    check_turn_pace,
    check_way,
)
from raccoon.robot.motions.pacing import LAG_LIMIT, LAG_LIMIT_TURN, MotionResult, Pace, finish_motion

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

__all__ = ["MotionResult", "arc", "pivot", "straight", "turn", "turn_to"]

# A plan further than this from the estimate is not continued: somebody moved the robot.
PLAN_REACH = 0.05
PLAN_REACH_HEADING = 0.3
HALF_TURN_MARGIN = math.radians(2.0)
"""rad; nearer to half a turn than this both directions count as equally short, since a heading is hardly
known better."""
FAR_RADIUS_M = 0.5
"""m, radius of an arc at which heading and position measure the progress equally well: 0.1 deg is 1 mm."""


def straight(
    distance: float,
    speed: float | None = None,
    *,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Drive `distance` m straight (negative: backwards), ending at rest.

    speed: m/s, the highest on the way; robot.toml's `motion.speed` when None. tolerance: m. timeout: s until
    it gives up; when None twice the expected time and 2 s more. Raises ValueError at once for numbers that
    are not allowed; MotionTimeout, with the reason, if it does not arrive.
    """
    check_way(distance=distance)
    check_pace("give the sign to the distance", speed=speed)
    check_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)
    distance = float(distance)  # of NumPy's too: results and plans are of plain numbers

    def steps(robot: Robot) -> Steps[MotionResult]:
        motion = robot.config.motion
        start = robot.plan
        wanted = motion.speed if speed is None else float(speed)
        top, acceleration = robot.drive.speeds.planned(wanted, motion.acceleration)
        walk = profile(distance, top, acceleration, motion.jerk)
        pace = Pace(robot, walk, LAG_LIMIT, timeout, top / wanted)
        for state in pace.states(lambda: start.offset_of(robot.estimate.x, robot.estimate.y)[0], start.ahead):
            along, across = start.offset_of(robot.estimate.x, robot.estimate.y)
            off = robot.estimate.heading - start.heading
            if pace.may_end(distance - along, tolerance):
                break
            velocity, turn_rate = line_command(state, along, across, off)
            robot.drive.follow(velocity, turn_rate, state.acceleration)
            yield
        return finish_motion(robot, start.ahead(distance), pace)

    return Action(f"straight {distance:g} m", steps)


def turn(
    angle: float,
    turn_rate: float | None = None,
    *,
    turns: float = 1.0,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Turn on the spot by `angle` rad (left is positive), ending at rest.

    turn_rate: rad/s, the highest on the way; robot.toml's `motion.turn_rate` when None. turns: largest angle
    in full turns. tolerance: rad. timeout: s. Raises as `straight`.
    """
    check_heading_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)
    check_angle(turns, angle=angle)
    check_turn_pace("give the sign to the angle", turn_rate=turn_rate)
    return Action(
        f"turn {math.degrees(angle):g} deg",
        lambda robot: turn_steps(robot, angle, turn_rate, tolerance, timeout),
    )


def turn_to(
    heading: float,
    turn_rate: float | None = None,
    *,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Turn the shorter way to a heading of the field, rad counter-clockwise from the robot's first heading.

    A half turn goes in the direction from the old number to the new one. Otherwise as `turn`.
    """
    check_heading(heading=heading)
    check_turn_pace(turn_rate=turn_rate)
    check_heading_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)

    def steps(robot: Robot) -> Steps[MotionResult]:
        angle = heading - robot.plan.heading
        return (yield from turn_steps(robot, shorter_way(angle, angle), turn_rate, tolerance, timeout))

    return Action(f"turn to {math.degrees(heading):g} deg", steps)


def shorter_way(angle: float, side: float = 1.0) -> float:
    """`angle` (rad) without its full turns, the shorter way. side: direction of a half turn, left if
    positive; otherwise the noise of the heading would decide it anew each time."""
    shorter = math.remainder(angle, math.tau)
    way = math.copysign(1.0, side)
    return shorter + way * math.tau if way * shorter < HALF_TURN_MARGIN - math.pi else shorter


def turn_steps(
    robot: Robot,
    angle: float,
    turn_rate: float | None = None,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Steps[MotionResult]:
    """The steps of a turn on the spot."""
    motion = robot.config.motion
    start = robot.plan
    angle = float(angle)
    wanted = motion.turn_rate if turn_rate is None else float(turn_rate)
    top, acceleration = robot.drive.speeds.planned_turn(wanted, motion.turn_acceleration)
    walk = profile(angle, top, acceleration, motion.turn_jerk)
    pace = Pace(robot, walk, LAG_LIMIT_TURN, timeout, top / wanted, "turn", 1.0)
    for state in pace.states(lambda: robot.estimate.heading - start.heading, start.turned):
        turned = robot.estimate.heading - start.heading
        if pace.may_end(angle - turned, tolerance):
            break
        robot.drive.follow(0.0, turn_command(state, turned), 0.0, state.acceleration)
        yield
    return finish_motion(robot, start.turned(angle), pace)


def arc(
    radius: float,
    angle: float,
    speed: float | None = None,
    *,
    backwards: bool = False,
    turns: float = 1.0,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Drive along a circle of `radius` m through `angle` rad (left is positive), ending at rest.

    The centre is on the side to which it turns (on the other side if it drives backwards). speed: m/s of the
    outer wheel, the highest on the way. turns: largest angle in full turns. tolerance: m of that wheel.
    timeout: s. Raises as `straight`.
    """
    check_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)
    check_angle(turns, angle=angle)
    check_pace("give the sign to the angle; backwards=True drives backwards", speed=speed)
    check_way(radius=radius)
    if not radius > 0.0:
        raise ValueError(f"radius is {radius} m: it must be above 0 (turn() turns on the spot)")
    signed = math.copysign(radius, -angle if backwards else angle)
    return Action(
        f"arc {radius:g} m {math.degrees(angle):g} deg",
        lambda robot: _arc_steps(robot, "arc", signed, angle, speed, tolerance, timeout),
    )


def pivot(
    angle: float,
    wheel: Literal["left", "right"],
    speed: float | None = None,
    *,
    turns: float = 1.0,
    tolerance: float | None = None,
    timeout: float | None = None,
) -> Action[MotionResult]:
    """Turn by `angle` rad (left is positive) about one wheel, which stands still: "left" or "right".

    speed: m/s of the other wheel, the highest on the way. turns: largest angle in full turns. tolerance: m of
    that wheel. timeout: s. Raises as `straight`.
    """
    check_tolerance(tolerance=tolerance)
    check_times(timeout=timeout)
    check_angle(turns, angle=angle)
    check_pace("give the sign to the angle", speed=speed)
    if wheel not in ("left", "right"):
        raise ValueError(f"wheel is {wheel!r}: allowed are 'left' and 'right'")
    side = 1.0 if wheel == "left" else -1.0

    def steps(robot: Robot) -> Steps[MotionResult]:
        signed = side * robot.drive.half_track
        return (yield from _arc_steps(robot, "pivot", signed, angle, speed, tolerance, timeout))

    return Action(f"pivot {math.degrees(angle):g} deg about the {wheel} wheel", steps)


def _arc_steps(
    robot: Robot,
    what: str,
    signed: float,
    angle: float,
    speed: float | None,
    tolerance: float | None,
    timeout: float | None,
) -> Steps[MotionResult]:
    """The steps of an arc about a centre `signed` m to the left; the way is signed * angle, negative
    backwards. what: the action's description."""
    motion = robot.config.motion
    start = robot.plan
    angle = float(angle)
    outer = 1.0 + robot.drive.half_track / abs(signed)  # the outer wheel keeps the limit
    wanted = (motion.speed if speed is None else float(speed)) / outer
    top, acceleration = robot.drive.speeds.planned(wanted, motion.acceleration, outer)
    pace = Pace(
        robot,
        profile(signed * angle, top, acceleration, motion.jerk),
        LAG_LIMIT,
        timeout,
        top / wanted,
        what,
        signed,
    )

    centre = start.x - signed * math.sin(start.heading), start.y + signed * math.cos(start.heading)
    by_place = signed * signed / (signed * signed + FAR_RADIUS_M * FAR_RADIUS_M)

    def turned() -> float:
        """Progress along the arc, rad: from the heading on a tight arc, from the position on a wide one."""
        here = robot.estimate
        bearing = math.atan2((here.x - centre[0]) / signed, (centre[1] - here.y) / signed)
        return here.heading - start.heading + by_place * math.remainder(bearing - here.heading, math.tau)

    for state in pace.states(lambda: signed * turned(), lambda way: start.along_arc(signed, way / signed)):
        done = turned()
        along, here = signed * done, start.along_arc(signed, done)
        _, across = here.offset_of(robot.estimate.x, robot.estimate.y)
        if pace.may_end(outer * (signed * angle - along), tolerance):
            break
        off = robot.estimate.heading - here.heading
        velocity, turn_rate = line_command(state, along, across, off)
        robot.drive.follow(
            velocity, turn_rate + velocity / signed, state.acceleration, state.acceleration / signed
        )
        yield
    return finish_motion(robot, start.along_arc(signed, angle), pace)
