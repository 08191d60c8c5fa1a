"""The servos and mechanisms of robot.toml, handled together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeVar

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.core.readings import SERVO_PORTS, STOP, Inputs, Outputs
from raccoon.robot.parts.mechanism import Mechanism
from raccoon.robot.parts.servos import Servo

T = TypeVar("T")


class Attachments:
    """Servos and mechanisms by name. They add their part to the drive's command in each tick."""

    def __init__(self, config: RobotConfig) -> None:
        self.servos = {name: Servo(name, each) for name, each in config.servos.items()}
        self.mechanisms = {name: Mechanism(name, each, config) for name, each in config.mechanisms.items()}

    def sense(self, inputs: Inputs, dt: float) -> None:
        """Take the readings of a cycle."""
        for mechanism in self.mechanisms.values():
            mechanism.sense(inputs, dt)

    @property
    def held(self) -> tuple[str, ...]:
        """Names of the mechanisms that are held or moved."""
        return tuple(name for name, each in self.mechanisms.items() if each.goal is not None)

    @property
    def moving(self) -> tuple[str, ...]:
        """What the mechanisms do that are moved by an action, in words."""
        return tuple(
            f"{name} at {math.degrees(each.angle):.0f} deg, "
            + (each.stall_reason if each.stalled else "turning")
            for name, each in self.mechanisms.items()
            if each.moved_by is not None
        )

    @property
    def servo_moves(self) -> bool:
        """Whether an action moves a servo."""
        return any(each.moved_by is not None for each in self.servos.values())

    def resume(self) -> None:
        """Continue after a pause in which nothing was controlled."""
        for mechanism in self.mechanisms.values():
            mechanism.resume()

    def add_to(self, outputs: Outputs, dt: float, battery_voltage: float | None, *, resting: bool) -> Outputs:
        """The drive's command with that of the attachments added. resting: see `Mechanism.duty`."""
        if not self.servos and not self.mechanisms:
            return outputs
        duty = list(outputs.duty)
        brake = list(outputs.brake)
        for mechanism in self.mechanisms.values():
            port = mechanism.config.motor
            duty[port] = mechanism.duty(dt, battery_voltage, resting=resting)
            brake[port] = mechanism.goal is not None
        return Outputs(tuple(duty), tuple(brake), self._pulses())

    def stop_motors(self) -> Outputs:
        """Every motor off, mechanisms released. Servos hold: a fault must not drop what they carry."""
        for mechanism in self.mechanisms.values():
            mechanism.release()
        return Outputs(servo_us=self._pulses()) if self.servos else STOP

    def switch_off(self) -> None:
        """Servos off with the next command."""
        for servo in self.servos.values():
            servo.switch_off()

    def _pulses(self) -> tuple[int | None, ...]:
        pulses: list[int | None] = [None] * SERVO_PORTS
        for servo in self.servos.values():
            if servo.pulse is not None:
                pulses[servo.config.port] = round(servo.pulse)
        return tuple(pulses)


def find_named(group: str, known: Mapping[str, T], name: str) -> T:
    """The entry of a section of robot.toml. Raises ConfigError naming those that exist."""
    try:
        return known[name]
    except KeyError:
        names = ", ".join(known) or f"none: [{group}.NAME] makes one"
        raise ConfigError(
            f"there is no {group} {name!r} in robot.toml{did_you_mean(name, known)}; there is {names}"
        ) from None
