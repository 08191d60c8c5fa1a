"""The conditions that end actions: `drive(0.2).until(on_black("left") | after_distance(0.5))`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from raccoon.control.wheel_watch import STALL_TIME_S
from raccoon.core.errors import ConfigError
from raccoon.core.port import bystander_of
from raccoon.core.readings import ANALOG_FULL_SCALE, ANALOG_PORTS, DIGITAL_PORTS
from raccoon.estimate.drive.estimate import HELD
from raccoon.robot.actions.condition import Check, Condition, Test, checked_truth
from raccoon.robot.actions.limits import (
    check_angle,
    check_counts,
    check_function,
    check_name,
    check_port,
    check_wait,
    check_way,
)
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

HELD_TIME_S = 0.5
"""s for which a state of the odometry from before the action counts as old; its reasons last for 0.3 s."""


def when(test: Callable[[Robot], bool], name: str = "when") -> Condition:
    """A condition from any predicate of the robot, tested once a tick."""
    check_function(test, "when()", "robot")

    def start(robot: Robot) -> Test:
        def holds() -> bool:
            told: object = test(robot)
            return told if isinstance(told, bool) else checked_truth(told, name)

        return holds

    return Condition(name, start)


def after_time(seconds: float) -> Condition:
    """`seconds` s after the start of the action."""
    check_wait(seconds)

    def start(robot: Robot) -> Test:
        begin = robot.time
        return lambda: robot.time - begin >= seconds

    return Condition(f"after {seconds:g} s", start)


def after_distance(distance: float) -> Condition:
    """After `distance` m of travel, forwards or backwards, since the start of the action."""
    check_way(distance=distance)

    def start(robot: Robot) -> Test:
        driven = change_since_start(robot, lambda: robot.estimate.distance)
        return lambda: abs(driven()) >= abs(distance)

    return Condition(f"after {distance:g} m", start)


def after_angle(angle: float, *, turns: float = 1.0) -> Condition:
    """After turning by `angle` rad, either way, since the start of the action.

    turns: the most full turns that are meant.
    """
    check_angle(turns, angle=angle)

    def start(robot: Robot) -> Test:
        turned = change_since_start(robot, lambda: robot.estimate.heading)
        return lambda: abs(turned()) >= abs(angle)

    return Condition(f"after {angle:g} rad", start)


def change_since_start(robot: Robot, value: Callable[[], float]) -> Callable[[], float]:
    """By how much a value of the odometry has changed since now; a reset of the odometry is no change."""
    begin = last = value()
    resets = robot.odometry.resets

    def change() -> float:
        nonlocal begin, last, resets
        now = value()
        if robot.odometry.resets != resets:
            begin, resets = begin + now - last, robot.odometry.resets
        last = now
        return now - begin

    return change


def on_black(tophat: str) -> Condition:
    """The named tophat sees black. A calibration is needed (CalibrationError at the start otherwise)."""
    return _on_surface(tophat, True)


def on_white(tophat: str) -> Condition:
    """The named tophat sees white. A calibration is needed (CalibrationError at the start otherwise)."""
    return _on_surface(tophat, False)


def over_line(tophat: str) -> Condition:
    """The named tophat has crossed a line: it saw black and then white."""
    check_name(tophat=tophat)

    def start(robot: Robot) -> Test:
        sensor = robot.tophat(tophat)
        sensor.require()
        seen = False

        def test() -> bool:
            nonlocal seen
            seen = seen or sensor.black is True
            return seen and sensor.black is False

        return test

    return Condition(f"over the line at {tophat}", start, check=lambda robot: robot.tophat(tophat))


def _on_surface(tophat: str, black: bool) -> Condition:
    check_name(tophat=tophat)

    def start(robot: Robot) -> Test:
        sensor = robot.tophat(tophat)
        sensor.require()
        return lambda: sensor.black is black

    name = f"{tophat} on {'black' if black else 'white'}"
    return Condition(name, start, check=lambda robot: robot.tophat(tophat))


def analog_above(port: int, counts: float) -> Condition:
    """The analog port reads more than `counts` (from 0 to 4095)."""
    check_port("analog", port, ANALOG_PORTS)
    check_counts(counts, ANALOG_FULL_SCALE)
    return when(lambda robot: _is_above(robot.analog(port), counts), f"analog {port} above {counts:g}")


def analog_below(port: int, counts: float) -> Condition:
    """The analog port reads less than `counts` (from 0 to 4095)."""
    check_port("analog", port, ANALOG_PORTS)
    check_counts(counts, 0)
    return when(lambda robot: _is_below(robot.analog(port), counts), f"analog {port} below {counts:g}")


def pressed(port: int) -> Condition:
    """The digital port is closed."""
    check_port("digital", port, DIGITAL_PORTS)
    return when(lambda robot: robot.digital(port) is True, f"digital {port} pressed")


def button_pressed() -> Condition:
    """The Wombat's own button is pressed.

    In simulation the bystander presses it for a program that does nothing but wait for it,
    `wait_for(button_pressed())`; otherwise nobody does, which is reported. Raises ConfigError before anything
    moves if the controller has no button.
    """

    def check(robot: Robot) -> None:
        if robot.config.controller.port == "create":
            raise ConfigError("a Create has no such button: its own are pressed(8) and pressed(9)")

    def start(robot: Robot) -> Test:
        somebody = bystander_of(robot.port)
        if somebody is not None and not somebody.presses:
            add_remark(robot, "a simulated button is pressed only for wait_for(button_pressed()) alone")
        return lambda: robot.button is True

    return Condition("button pressed", start, check=check, asks=lambda somebody: somebody.press_button())


def stalled() -> Condition:
    """A driven wheel does not turn: the robot is blocked, or a motor is unplugged."""
    return _fresh_condition("stalled", (_is_wheel_stalled, STALL_TIME_S))


def blocked(mechanism: str) -> Condition:
    """The named mechanism is driven and does not turn: it is at its end stop, or holds something."""
    check_name(mechanism=mechanism)
    test = (lambda robot: robot.mechanism(mechanism).stalled, STALL_TIME_S)
    return _fresh_condition(f"{mechanism} blocked", test, check=lambda robot: robot.mechanism(mechanism))


def bumped() -> Condition:
    """A wheel stalls, both wheels carry the torque of tyres that spin at a wall, or they turn differently
    from the motion that the accelerometer measures."""
    return _fresh_condition(
        "bumped", (_is_struck, math.inf), (_is_held, HELD_TIME_S), (_is_wheel_stalled, STALL_TIME_S)
    )


def _is_struck(robot: Robot) -> bool:
    return any(why.startswith("bumped") for why in robot.estimate.reasons)


def _is_held(robot: Robot) -> bool:
    return HELD in robot.estimate.reasons


def _is_wheel_stalled(robot: Robot) -> bool:
    return bool(robot.drive.wheels.stalled)


def _fresh_condition(
    name: str, *tests: tuple[Callable[[Robot], bool], float], check: Check | None = None
) -> Condition:
    """Any of `tests`, each with the time (s) for which it must last if it holds at the start (see
    `_fresh_test`)."""

    def start(robot: Robot) -> Test:
        asked = [_fresh_test(robot, test, lasting) for test, lasting in tests]

        def any_anew() -> bool:
            answers = [each() for each in asked]  # all of them every tick: each has a memory
            return any(answers)

        return any_anew

    def holds(robot: Robot) -> Test:
        return lambda: any(test(robot) for test, _ in tests)

    return Condition(name, start, opposed=holds, check=check)


def _fresh_test(robot: Robot, test: Callable[[Robot], bool], lasting: float) -> Test:
    """`test`, except that if it holds at the start it must become true anew, or last for `lasting` s.

    The action before may have been ended by it, and this action drives away from it.
    """
    begin, old = robot.time, test(robot)

    def anew() -> bool:
        nonlocal old
        holds = test(robot)
        old = old and holds and robot.time - begin <= lasting
        return holds and not old

    return anew


def _is_above(value: float | None, limit: float) -> bool:
    return value is not None and value > limit


def _is_below(value: float | None, limit: float) -> bool:
    return value is not None and value < limit
