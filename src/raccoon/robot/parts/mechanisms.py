"""Arms and grippers on motors of their own: move to an angle and hold it, turn until something happens.

The controller counts the angle from the back-EMF, as for the wheels. It is 0 where the mechanism stood when
the robot was opened, or where `zero` was called: an arm that must be exact is driven against its end stop
first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from raccoon.control.profile import ProfileState, profile
from raccoon.core.errors import MotionTimeout
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.functions import do
from raccoon.robot.actions.limits import (
    check_angle,
    check_finite,
    check_name,
    check_rate,
    check_times,
    check_turn_pace,
)
from raccoon.robot.parts.movable import exclusive_use, require_free, require_wombat
from raccoon.robot.remarks import EndlessRemark, add_remark

if TYPE_CHECKING:
    from raccoon.robot.parts.mechanism import Mechanism
    from raccoon.robot.robot import Robot

__all__ = ["move", "move_by", "release", "spin", "zero"]

MARGIN_TIME_S = 2.0
"""s beyond twice the duration of its profile that a move may take."""


def move(name: str, to: float, speed: float | None = None, *, timeout: float | None = None) -> Action[float]:
    """Turn the mechanism `name` to the angle `to` (rad from its zero) and hold it there.

    speed: rad/s, its `speed` of robot.toml when None. timeout: s. The result is the angle that it reached.
    Raises before it moves: ValueError for more full turns than its `turns` of robot.toml, RuntimeError if
    another action still moves it. Raises MotionTimeout, naming the motor port, if it is blocked or too slow;
    it is released then.
    """
    check_name(name=name)
    check_finite(to=to)
    check_turn_pace(speed=speed)
    check_times(timeout=timeout)

    label = f"move {name} to {math.degrees(to):g} deg"

    def steps(robot: Robot) -> Steps[float]:
        with exclusive_use(robot.mechanism(name), label):
            return (yield from _move(robot, name, lambda _: to, speed, timeout))

    return Action(label, steps, lambda robot: _check_turns(robot, name, to=to))


def move_by(
    name: str, angle: float, speed: float | None = None, *, timeout: float | None = None
) -> Action[float]:
    """Turn the mechanism `name` by `angle` rad and hold it there. See `move`.

    It starts from where it is held, or from its present angle after `release`, `zero`, `spin` and a timeout.
    """
    check_name(name=name)
    check_finite(angle=angle)
    check_turn_pace("give the sign to the angle", speed=speed)
    check_times(timeout=timeout)

    label = f"move {name} by {math.degrees(angle):g} deg"

    def steps(robot: Robot) -> Steps[float]:
        with exclusive_use(robot.mechanism(name), label):
            return (yield from _move(robot, name, lambda moved: moved.place + angle, speed, timeout))

    return Action(label, steps, lambda robot: _check_turns(robot, name, angle=angle))


def spin(name: str, speed: float) -> Action[None]:
    """Turn the mechanism `name` at `speed` rad/s until ended from outside (`.until`, `.timeout`, `race`).
    Then it is released.

    `spin("arm", -2.0).until(blocked("arm"))` drives it against its end stop. Raises RuntimeError if another
    action still moves it.
    """
    check_name(name=name)
    check_rate(speed=speed)
    check_finite(speed=speed)  # None is no default here

    label = f"spin {name} at {speed:g} rad/s"

    def steps(robot: Robot) -> Steps[None]:
        turned = robot.mechanism(name)
        with exclusive_use(turned, label):
            rate = math.copysign(_planned_speed(robot, turned, abs(speed)), speed)
            endless = EndlessRemark(robot, label, f".until(blocked({name!r})) or .timeout(seconds)")
            try:
                while True:
                    endless.tell()
                    turned.goal = ProfileState(turned.angle, rate, 0.0)
                    yield
            finally:
                turned.release()

    return Action(label, steps, lambda robot: _require_mechanism(robot, name))


def release(name: str) -> Action[None]:
    """Release the mechanism `name`: its motor is switched off. Raises RuntimeError if an action moves it."""
    check_name(name=name)
    label = f"release {name}"

    def let_go(robot: Robot) -> None:
        free = robot.mechanism(name)
        require_free(free, label)
        free.release()

    return Action(label, do(let_go).start, lambda robot: _require_mechanism(robot, name))


def zero(name: str, angle: float = 0.0) -> Action[None]:
    """Set the present angle of the mechanism `name` to `angle` rad, and release it. Raises RuntimeError if
    another action still moves it."""
    check_name(name=name)
    check_finite(angle=angle)
    label = f"zero {name}"

    def set_angle(robot: Robot) -> None:
        here = robot.mechanism(name)
        require_free(here, label)
        here.release()
        here.count_from(float(angle))

    return Action(label, do(set_angle).start, lambda robot: _check_turns(robot, name, angle=angle))


def _require_mechanism(robot: Robot, name: str) -> Mechanism:
    """The mechanism of that name. Raises ConfigError where there is none."""
    there = robot.mechanism(name)
    require_wombat(robot, "mechanism", name)
    return there


def _check_turns(robot: Robot, name: str, **angles: float) -> None:
    """Raise ValueError for an angle beyond this mechanism's `turns` of robot.toml."""
    turns = _require_mechanism(robot, name).config.turns
    check_angle(turns, f"mechanism.{name}.turns of robot.toml allows more", **angles)


def _move(
    robot: Robot, name: str, to: Callable[[Mechanism], float], speed: float | None, timeout: float | None
) -> Steps[float]:
    moved = robot.mechanism(name)
    start, config = moved.angle, moved.config
    top = _planned_speed(robot, moved, config.speed if speed is None else speed)
    walk = profile(to(moved) - start, top, config.acceleration, 0.0)
    goal, sign = start + walk.distance, math.copysign(1.0, walk.distance)
    allowed = 2.0 * walk.duration + MARGIN_TIME_S if timeout is None else timeout
    begin = walked = robot.time
    arrived = False
    moved.forget_stall()
    try:
        while not arrived:
            elapsed = robot.time - begin
            behind = sign * (start + walk.at(robot.time - walked).position - moved.angle)
            if robot.paused and behind > config.tolerance:
                # Its motor was stopped meanwhile: it speeds up anew, and makes up for nothing.
                start, walked = moved.angle, robot.time
                walk = walk.over(goal - start)
            state = walk.at(robot.time - walked)
            moved.goal = ProfileState(start + state.position, state.velocity, state.acceleration)
            if moved.stalled or elapsed > allowed:
                raise MotionTimeout(_describe_timeout(moved, goal, elapsed))
            arrived = robot.time - walked >= walk.duration and moved.settled
            yield
    finally:
        if not arrived:
            moved.release()
    return moved.angle


def _planned_speed(robot: Robot, moved: Mechanism, wanted: float) -> float:
    """The speed (rad/s) with which to turn it; reports if its angle would not be readable at the `wanted`
    speed."""
    top = moved.planned_speed(wanted)
    if top > wanted:
        add_remark(
            robot,
            f"{moved.name} is turned at {top:.2f} rad/s at least: the controller cannot count slower "
            "motors, so its angle would be unknown",
        )
    if top < wanted:
        add_remark(
            robot,
            f"{moved.name} is turned at {top:.2f} rad/s at most: the controller cannot read the back-EMF "
            "of faster motors, so its angle would be unknown",
        )
    return top


def _describe_timeout(moved: Mechanism, goal: float, elapsed: float) -> str:
    cause = moved.stall_reason if moved.stalled else "too slow"
    return (
        f"{moved.name} (motor port {moved.config.motor}) not done after {elapsed:.1f} s: at"
        f" {math.degrees(moved.angle):.0f} of {math.degrees(goal):.0f} deg; {cause}"
    )
