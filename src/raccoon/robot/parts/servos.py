"""Servos: go to a position by name or by pulse, at once or slowly, while other things go on.

A servo reports nothing, so an action ends when the servo has had the time for its way (`speed_us` of
robot.toml). It holds until it is sent elsewhere, switched off, or the robot is closed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NoReturn

from raccoon.core.config import ServoConfig
from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.functions import do
from raccoon.robot.actions.limits import check_name, check_number, check_times
from raccoon.robot.name_hints import Part
from raccoon.robot.parts.movable import exclusive_use, require_free, require_wombat

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

__all__ = ["Servo", "servo", "servo_off"]


class Servo(Part):
    """One named servo of robot.toml."""

    called = "robot.run(servo(name, place))"
    offers = "pulse"

    def __init__(self, name: str, config: ServoConfig) -> None:
        self.name = name
        self.config = config
        self._pulse: float | None = None
        self.moved_by: str | None = None
        """The action that is moving it."""
        self._side, self._arrives = 0.0, -math.inf  # the way it comes to `pulse`, 0 where unknown; s of then

    @property
    def pulse(self) -> float | None:
        """us, as commanded; None while it is off or was never used."""
        return self._pulse

    if not TYPE_CHECKING:  # a type checker knows that it is not set

        @pulse.setter
        def pulse(self, pulse: object) -> NoReturn:
            # Nobody would look at what the mechanism stands.
            raise AttributeError(
                f"a pulse cannot be set directly: write robot.run(servo({self.name!r}, {pulse!r}))"
            )

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
                meant = did_you_mean(where, config.positions_us)
                raise ConfigError(
                    f"servo.{self.name} has no position {where!r}{meant}; positions_us has {known}"
                )
            return config.positions_us[where]
        if not config.lowest_us <= where <= config.highest_us:
            raise ValueError(
                f"pulse of servo {self.name} is {where} us: allowed are {config.lowest_us:g} to"
                f" {config.highest_us:g}"
            )
        return float(where)

    def send(self, pulse: float, time: float, lasts: float = 0.0) -> None:
        """Command `pulse` us from `time` s on; lasts: s until it should be there."""
        here = self.pulse_at(time)
        self._side = 0.0 if here is None else math.copysign(1.0, pulse - here)
        self._pulse, self._arrives = pulse, time + lasts

    def switch_off(self) -> None:
        """Switch it off from the next command on: it can be turned by hand."""
        self._pulse = None

    def pulse_at(self, time: float) -> float | None:
        """The pulse (us) that its position should correspond to at `time` s, also on a way that its action
        did not wait for; None if unknown."""
        left = max(0.0, self._arrives - time) * self.config.speed_us
        if self.pulse is None or left == 0.0:
            return self.pulse
        return self.pulse - self._side * left if self._side else None

    def travel_time(self, pulse: float, time: float) -> float:
        """s to get to `pulse` us from its position at `time` s; from the far end if that is unknown."""
        here, ends = self.pulse_at(time), (self.config.lowest_us, self.config.highest_us)
        way = max(abs(pulse - end) for end in ends) if here is None else abs(pulse - here)
        return way / self.config.speed_us


SLOWEST_S = 60.0
"""s; longest duration of a servo's way, half a match. A longer one is in milliseconds."""


def servo(name: str, to: str | float, seconds: float | None = None) -> Action[None]:
    """Send the servo `name` to a position: a name of its `positions_us`, or a pulse in us.

    seconds: duration of an even motion; as fast as it can when None. It ends when the servo should be there;
    in `parallel` or `background` other things go on meanwhile. Raises ConfigError for a servo or position
    that robot.toml does not have, ValueError for a pulse outside its range, RuntimeError if another action
    still moves it.
    """
    check_name(name=name)
    check_times(seconds=seconds)
    if seconds is not None and seconds > SLOWEST_S:
        raise ValueError(f"seconds is {seconds}: allowed are numbers up to {SLOWEST_S:g} s (500 ms are 0.5)")
    if not isinstance(to, str):
        check_number("to", to, "a pulse in us, or a name")
        if not math.isfinite(to):
            raise ValueError(f"to is {to}: it must be a name or a pulse in us")

    label = f"servo {name} to {to}"

    def steps(robot: Robot) -> Steps[None]:
        moved = robot.servo(name)
        goal = moved.place(to)
        with exclusive_use(moved, label):
            begin = last = robot.time
            start = None if seconds is None else moved.pulse_at(begin)  # where it begins to go evenly
            way = moved.travel_time(goal, begin)
            lasts = way if seconds is None else max(seconds, way)
            if start is None:
                moved.send(goal, begin, way)
            while (share := (robot.time - begin) / lasts if lasts > 0.0 else 1.0) < 1.0:
                if start is not None:
                    moved.send(start + share * (goal - start), robot.time)
                last = robot.time
                yield
                if robot.paused and seconds is not None:  # it stood meanwhile, where it was sent last
                    begin += robot.time - last - robot.dt
            if start is not None:
                moved.send(goal, robot.time)

    return Action(label, steps, lambda robot: _require_servo(robot, name).place(to))


def servo_off(name: str) -> Action[None]:
    """Switch the servo `name` off: it can be turned by hand until it is sent somewhere again.

    Raises ConfigError for a servo that robot.toml does not have, RuntimeError if an action still moves it.
    """
    check_name(name=name)
    label = f"servo {name} off"

    def switch_off(robot: Robot) -> None:
        off = robot.servo(name)
        require_free(off, label)
        off.switch_off()

    return Action(label, do(switch_off).start, lambda robot: _require_servo(robot, name))


def _require_servo(robot: Robot, name: str) -> Servo:
    """The servo of that name. Raises ConfigError where there is none."""
    there = robot.servo(name)
    require_wombat(robot, "servo", name)
    return there
