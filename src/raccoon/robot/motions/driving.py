"""Driving without a goal, until something ends it: at a speed, or with plain duties."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.control.motion import limit_slew, line_command
from raccoon.control.profile import ProfileState
from raccoon.control.voltage import VoltageScaling
from raccoon.core.errors import MotionTimeout
from raccoon.model.pose import Pose
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.conditions import change_since_start
from raccoon.robot.actions.limits import (
    check_battery_voltage,
    check_duties,
    check_finite,
    check_rate,
    check_speed,
)
from raccoon.robot.actions.steps import advance
from raccoon.robot.motions.pacing import STALL_PATIENCE_S, HeldWay, check_wiring, describe_obstacle
from raccoon.robot.remarks import EndlessRemark, PushingRemark, add_remark

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

__all__ = ["drive", "motors"]

SLOWER_SHARE, SLOWER_REMARK = 0.9, "slower than asked"
"""Share of the requested speed below which the lower speed is reported, as there is no result that shows it;
and the remark's kind."""


def drive(speed: float, turn_rate: float = 0.0) -> Action[None]:
    """Drive at `speed` m/s (negative: backwards) and `turn_rate` rad/s (left is positive) until ended from
    outside (`.until`, `.timeout`, `race`). Without a turn rate the planned heading is held. Raises
    MotionTimeout if the gyro shows for half a second that a motor is plugged in the other way round."""
    check_speed(speed=speed)
    check_rate(turn_rate=turn_rate)
    check_finite(speed=speed, turn_rate=turn_rate)  # None is no default here
    label = f"drive {speed:g} m/s"

    def steps(robot: Robot) -> Steps[None]:
        motion = robot.config.motion
        start, resets = robot.plan, robot.odometry.resets
        if robot.drive.is_looping(robot.time):
            add_remark(
                robot,
                "drive() is started again and again: it speeds up from rest each time and stays slow; in "
                "a loop set the speed of each cycle with robot.drive.velocity() and robot.tick()",
            )
        velocity, rate = robot.estimate.velocity, robot.estimate.turn_rate
        miswired = 0.0
        counted = turn_rate == 0.0  # otherwise it would be another circle
        top, acceleration = robot.drive.speeds.planned(abs(speed), motion.acceleration, counted=counted)
        if top < SLOWER_SHARE * abs(speed) and not robot.drive.speeds.was_limited:
            _remark_slower(robot, label, top)
        top = math.copysign(top, speed)
        endless = EndlessRemark(robot, label, ".until(...) or .timeout(seconds)")
        pushing = PushingRemark(robot, label)
        try:
            while True:
                endless.tell()
                pushing.tell()
                if robot.paused:  # the motors may have been stopped meanwhile
                    velocity, rate = robot.estimate.velocity, robot.estimate.turn_rate
                if robot.odometry.resets != resets:  # from here on it is another frame
                    start, resets = robot.plan, robot.odometry.resets
                miswired = check_wiring(robot, miswired, label)
                velocity = limit_slew(velocity, top, acceleration * robot.dt)
                rate = limit_slew(rate, turn_rate, motion.turn_acceleration * robot.dt)
                held = 0.0
                if turn_rate == 0.0:
                    _, across = start.offset_of(robot.estimate.x, robot.estimate.y)
                    off = robot.estimate.heading - start.heading
                    state = ProfileState(0.0, velocity, 0.0)
                    _, held = line_command(state, 0.0, across, off)
                robot.drive.follow(velocity, rate + held)
                if turn_rate != 0.0 and robot.drive.cut:
                    robot.drive.speeds.was_limited = True
                yield
        finally:
            robot.drive.stop()
            here = robot.estimate
            robot.plan = Pose(here.x, here.y, start.heading if turn_rate == 0.0 else here.heading)

    return Action(label, steps)


def _remark_slower(robot: Robot, label: str, top: float) -> None:
    """Report that a drive is limited to `top` m/s."""
    least = f"a battery at battery.weakest ({robot.config.battery.weakest:g} V) gives no more"
    add_remark(robot, f"{label}: limited to {top:.2f} m/s, because {least}", SLOWER_REMARK)


def drive_until_stopped(speed: float, reach: float, timeout: float | None = None) -> Action[float]:
    """Drive at `speed` m/s (negative: backwards) until `reach` m are driven or it is ended from outside.

    The result is the part of the reach (m) that a wall may have kept it from driving. Raises ValueError for a
    speed of 0, MotionTimeout if a wheel has not turned for 0.4 s, or after `timeout` s (None: twice the
    expected time and 2 s).
    """
    check_speed(speed=speed)
    if speed == 0.0:
        raise ValueError("speed is 0: allowed are numbers above or below it")

    def steps(robot: Robot) -> Steps[float]:
        begin, silent = robot.time, 0.0
        driven = change_since_start(robot, lambda: robot.estimate.distance)
        held = HeldWay(robot)
        acceleration = robot.config.motion.acceleration
        top, acceleration = robot.drive.speeds.planned(abs(speed), acceleration)
        usual = 2.0 * (reach / top + top / acceleration) + 2.0
        allowed = usual if timeout is None else timeout
        body = drive(speed).start(robot)
        try:
            while (way := abs(driven())) <= reach:
                silent = silent + robot.dt if robot.drive.wheels.stalled else 0.0
                seconds = robot.time - begin
                if silent > STALL_PATIENCE_S or seconds > allowed:
                    done = f"drive not done after {seconds:.1f} s: {way:.3f} of {reach:g} m"
                    raise MotionTimeout(f"{done}; {describe_obstacle(robot)}")
                held.update()
                advance(body)
                yield
            return held.remark("drive")
        finally:
            body.close()

    return Action(f"search {reach:g} m", steps)


def motors(left: float, right: float, *, tuned_at: float | None = None) -> Action[None]:
    """Apply plain duties (-1..1) to the wheels until ended from outside: no control at all, for comparison.

    tuned_at: V of the battery on which the duties were tuned; they are scaled by it over the present voltage.
    What the present battery cannot give is reported once, in the log and the recording, with the missing
    speed.
    """
    check_duties(left, right)
    if tuned_at is not None:
        check_battery_voltage(tuned_at=tuned_at)
    scaling = None if tuned_at is None else VoltageScaling(tuned_at)

    label = f"motors {left:g} {right:g}"

    def steps(robot: Robot) -> Steps[None]:
        endless = EndlessRemark(robot, label, ".until(...) or .timeout(seconds)")
        try:
            while True:
                endless.tell()
                duties = left, right
                if scaling is not None:
                    scaled = [scaling.scale_duty(duty, robot.battery_voltage) for duty in duties]
                    duties = scaled[0].duty, scaled[1].duty
                    missing = max(each.missing for each in scaled)
                    if missing > 0.0:
                        speed = robot.drive.speed_of(missing * max(abs(left), abs(right)) * scaling.reference)
                        add_remark(
                            robot, f"voltage scaling: {100.0 * missing:.0f} % missing, {speed:.3f} m/s"
                        )
                robot.drive.duties(*duties)
                yield
        finally:
            robot.drive.stop()
            robot.replan()

    return Action(label, steps)
