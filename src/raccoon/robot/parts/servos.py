"""Servos: go to a place by name or by pulse, at once or slowly, and stay there while other things go on.

A servo reports nothing back, so an action ends when the servo has had the time for its way
(`speed_us` of robot.toml). It holds until it is sent elsewhere, switched off, or the robot is closed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.core.config import ServoConfig
from raccoon.core.errors import ConfigError
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.functions import do
from raccoon.robot.actions.limits import check_number, check_times
from raccoon.robot.instead import Part
from raccoon.robot.parts.holding import held, require_free

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

__all__ = ["Servo", "servo", "servo_off"]


class Servo(Part):
    """One named servo of robot.toml. pulse: us, as commanded; None while it is off or was never used."""

    called = "robot.run(servo(name, place))"
    offers = "pulse"

    def __init__(self, name: str, config: ServoConfig) -> None:
        self.name = name
        self.config = config
        self.pulse: float | None = None
        self.moved_by: str | None = None
        """The action that moves it now."""

    def __repr__(self) -> str:
        return f"<servo {self.name}: {'off' if self.pulse is None else f'{self.pulse:g} us'}>"

    def place(self, where: str | float) -> float:
        """The pulse (us) of a named place or of a number.

        Raises ConfigError for a name that robot.toml does not have, ValueError for a pulse out of range.
        """
        config = self.config
        if isinstance(where, str):
            if where not in config.positions_us:
                known = ", ".join(config.positions_us) or "none"
                raise ConfigError(f"servo.{self.name} has no position {where!r}; positions_us has {known}")
            return config.positions_us[where]
        if not config.lowest_us <= where <= config.highest_us:
            raise ValueError(
                f"pulse of servo {self.name} is {where} us: allowed are {config.lowest_us:g} to"
                f" {config.highest_us:g}"
            )
        return float(where)

    def travel_time(self, pulse: float) -> float:
        """s to get to `pulse` us from the last place; from the far end where that is unknown."""
        ends = self.config.lowest_us, self.config.highest_us
        way = max(abs(pulse - end) for end in ends) if self.pulse is None else abs(pulse - self.pulse)
        return way / self.config.speed_us


def servo(name: str, to: str | float, seconds: float | None = None) -> Action[None]:
    """Send the servo `name` to a place: a name of its `positions_us`, or a pulse in us.

    seconds: take that long, evenly; as fast as it can when None. Ends when the servo should be there; in
    `parallel` or `background` other things go on meanwhile. Raises ConfigError for a servo or place that
    robot.toml does not have, ValueError for a pulse outside its range, RuntimeError where another action
    still moves it.
    """
    check_times(seconds=seconds)
    if not isinstance(to, str):
        check_number("to", to, "a pulse in us, or a name")
        if not math.isfinite(to):
            raise ValueError(f"to is {to}: it must be a name or a pulse in us")

    label = f"servo {name} to {to}"

    def steps(robot: Robot) -> Steps[None]:
        moved = robot.servo(name)
        goal = moved.place(to)
        with held(moved, label):
            start = goal if moved.pulse is None or seconds is None else moved.pulse
            lasts = moved.travel_time(goal) if seconds is None else max(seconds, moved.travel_time(goal))
            begin = robot.time
            while (share := (robot.time - begin) / lasts if lasts > 0.0 else 1.0) < 1.0:
                moved.pulse = start + share * (goal - start)
                last = robot.time
                yield
                if robot.paused and seconds is not None:  # it stood meanwhile, where it was sent last
                    begin += robot.time - last - robot.dt
            moved.pulse = goal

    return Action(label, steps, lambda robot: robot.servo(name).place(to))


def servo_off(name: str) -> Action[None]:
    """Switch the servo `name` off: it gives way to the hand until it is sent somewhere again.

    Raises ConfigError for a servo that robot.toml does not have, RuntimeError where an action still moves it.
    """
    label = f"servo {name} off"

    def switch_off(robot: Robot) -> None:
        off = robot.servo(name)
        require_free(off, label)
        off.pulse = None

    return Action(label, do(switch_off).start, lambda robot: robot.servo(name))
