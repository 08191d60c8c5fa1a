"""Following a line with one tophat or two, with a search where the robot slid off or the light changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, overload

from raccoon.control.motion import limit_slew
from raccoon.core.errors import MotionTimeout
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.condition import Check
from raccoon.robot.actions.limits import check_name, check_pace
from raccoon.robot.motions.last_edge import LastEdge
from raccoon.robot.motions.line_search import CATCH_SPEED, OTHER_LIGHT_REASON, LineSearch, describe_lost_line
from raccoon.robot.motions.line_sight import BothEdges, OneEdge, check_pair, find_other_on_edge
from raccoon.robot.motions.line_steering import LineSteering
from raccoon.robot.motions.lines import tophat_ahead
from raccoon.robot.motions.pacing import check_wiring
from raccoon.robot.remarks import PushingRemark

if TYPE_CHECKING:
    from raccoon.robot.motions.line_sight import LineSight
    from raccoon.robot.robot import Robot

PROBE_WAY_M, PROBE_RATE, PROBE_TIME, PROBE_ANSWER = 0.003, 0.4, 0.4, 0.15
"""The test for an edge: m by which the sensor is moved, turn rate (rad/s), longest time (s), and the least
decrease of its share on black, half of what an edge gives."""
MAX_SEARCHES = 2
"""Searches for a line at one place; a line that ends would be searched for without end."""
TWO_TOPHATS_HINT = "write follow_line(left=..., right=...)"


@overload
def follow_line(
    tophat: str, side: Literal["left", "right"] = "left", speed: float | None = None
) -> Action[None]: ...


@overload
def follow_line(*, left: str, right: str, speed: float | None = None) -> Action[None]: ...


def follow_line(
    tophat: str | None = None,
    side: Literal["left", "right"] | None = None,
    speed: float | None = None,
    *,
    left: str | None = None,
    right: str | None = None,
) -> Action[None]:
    """Keep one tophat on an edge of a black line, or two around its middle, until ended from outside
    (`.until`, `race`).

    side: the edge of the line for one tophat, "left" (the default) or "right". left, right: two tophats
    instead, beside the line, on its edges or on it; the line is on the side of the darker one. speed: m/s;
    `motion.speed` when None.

    The share of a sensor's spot on black steers the robot and shows the line's bends. Crossing lines are
    driven over. After 1 s or 0.15 m without an edge (0.5 s if there was none yet) the robot stops, drives
    back to the last edge and searches for the line on the spot, with the sensor up to 90 degrees to either
    side, then with its axle over the end of the line, up to 165 degrees; if the light changed there, it
    measures floor and line anew. If a reading is steady for 5 cm and not half an edge, the sensor is moved by
    up to 3 mm to test whether it is on one.

    Raises CalibrationError without a calibration, ConfigError for a sensor that is not ahead of the axle and
    for two that cannot work as a pair, MotionTimeout if it finds no line or comes back along its own.
    """
    check_pace(speed=speed)
    if left is not None or right is not None:
        if tophat is not None or side is not None or left is None or right is None:
            raise TypeError(
                f"follow_line() takes one tophat and its edge, or two tophats: {TWO_TOPHATS_HINT}"
            )
        check_name(left=left, right=right)
        return _follow_action(
            f"follow the line with {left} and {right}",
            lambda robot: BothEdges(robot.tophat(left), robot.tophat(right)),
            speed,
            lambda robot: check_pair(robot, left, right),
        )
    if tophat is None:
        raise TypeError(f"follow_line() needs the name of one tophat, or of two: {TWO_TOPHATS_HINT}")
    check_name(tophat=tophat)
    edge = "left" if side is None else side
    if edge not in ("left", "right"):
        raise ValueError(
            f"side is {edge!r}: allowed are 'left' and 'right'; with two tophats {TWO_TOPHATS_HINT}"
        )
    return _follow_action(
        f"follow the {edge} edge with {tophat}",
        lambda robot: OneEdge(robot.tophat(tophat), 1.0 if edge == "left" else -1.0),
        speed,
        lambda robot: tophat_ahead(robot, tophat),
    )


def _follow_action(
    label: str, looking: Callable[[Robot], LineSight], speed: float | None, check: Check
) -> Action[None]:
    """The action. looking: makes what observes the line, for a robot."""

    def steps(robot: Robot) -> Steps[None]:
        sight, motion = looking(robot), robot.config.motion
        for sensor in sight.sensors:
            sensor.require()
        wanted = motion.speed if speed is None else speed
        top, acceleration = robot.drive.speeds.planned(wanted, motion.acceleration)
        steering = LineSteering(robot, sight)
        line = LastEdge(robot, sight.unseen_width, find_other_on_edge(robot, sight))
        velocity, limit, miswired = robot.estimate.velocity, top, 0.0
        pushing = PushingRemark(robot, label)
        _follow_light(robot, sight, False)
        try:
            while True:
                sight.look()
                pushing.tell()
                if sight.sees_floor and line.update(sight) and line.is_kept:
                    limit = top
                turn_rate = steering.turn_rate(velocity)
                answers = True
                if line.is_doubtful:
                    answers = yield from _probe_edge(robot, sight, velocity, turn_rate)
                    line.decide(answers)
                if robot.paused:  # the motors may have been stopped meanwhile
                    velocity = robot.estimate.velocity
                miswired = check_wiring(robot, miswired, label)
                other_light = sight.other_light or not answers
                if (line.is_lost and not steering.is_crossing) or other_light:
                    number = line.count_search()
                    if number > MAX_SEARCHES:
                        reason = OTHER_LIGHT_REASON if other_light else line.missed_for
                        raise MotionTimeout(describe_lost_line(robot, sight, reason))
                    search, again = LineSearch(robot, sight, line, velocity), number > 1
                    yield from search.learn_light() if other_light else search.search_both_sides(again=again)
                    line.mark_found()
                    velocity, limit = 0.0, min(top, CATCH_SPEED)
                    steering.restart()
                    continue
                velocity = limit_slew(velocity, steering.limited_speed(limit), acceleration * robot.dt)
                robot.drive.follow(velocity, turn_rate)
                yield
        finally:
            _follow_light(robot, sight, True)
            robot.drive.stop()
            robot.replan()

    return Action(label, steps, check)


def _follow_light(robot: Robot, sight: LineSight, on: bool) -> None:
    """See `TophatSensor.follow_light`. Sensors beside the line may ride along an edge: none is judged."""
    sight.follow_light(on)
    for each in robot.tophats.values():
        each.is_judged = on


def _probe_edge(robot: Robot, sight: LineSight, velocity: float, turn_rate: float) -> Steps[bool]:
    """Whether the sensor is on an edge: it is moved a little in the direction in which an edge would read
    nearer to half, only as far as needed. A surface in another light reads the same then. turn_rate: rad/s at
    which the robot follows."""
    begin, heading, before = robot.time, robot.estimate.heading, sight.offset
    way = 1.0 if before > 0.0 else -1.0
    while robot.time - begin < PROBE_TIME:
        further = robot.estimate.heading - heading - turn_rate * (robot.time - begin)
        if way * further * sight.reach > PROBE_WAY_M:
            break
        robot.drive.follow(velocity, turn_rate + way * PROBE_RATE)
        yield
        sight.look()
        if way * (before - sight.offset) > PROBE_ANSWER:
            return True
    return False
