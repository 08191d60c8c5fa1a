"""`robot.toml`: what a robot is made of.

Every key is optional; unknown keys and impossible values are refused. The file is described once, by the
dataclasses below; reading, checking and the reference page follow from them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.core.nominal import (
    MODEL_SECTIONS,
    BatteryModel,
    BemfModel,
    DriveModel,
    FrictionModel,
    ImuModel,
    MotorModel,
    NominalModel,
    parse_model,
)
from raccoon.core.readings import ANALOG_PORTS, MOTOR_PORTS, SERVO_PORTS, SERVO_PULSE_US
from raccoon.core.schema import (
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Measured,
    measured,
    named,
    number,
    optional,
    port,
    refuse_unknown,
    section,
    subtable,
    switch,
    template_line,
    word,
)

__all__ = [
    "BatteryConfig",
    "BatteryModel",
    "BemfModel",
    "ControllerConfig",
    "DriveConfig",
    "DriveModel",
    "FrictionModel",
    "ImuModel",
    "Measured",
    "MechanismConfig",
    "MotionConfig",
    "MotorConfig",
    "MotorModel",
    "NominalModel",
    "RobotConfig",
    "ServoConfig",
    "TophatConfig",
    "load_robot",
    "parse_robot",
    "template",
]

REAL_CONTROLLERS = ("wombat", "wombat-raccoon", "create")
CONTROLLERS = (*REAL_CONTROLLERS, "sim", "emulator", "emulator-raccoon")


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """`[controller]`: what the program talks to."""

    port: str = word("wombat", "what the program talks to", CONTROLLERS)
    rate_hz: float = number(200.0, "Hz", "cycles a second", Bounds(10.0, 1000.0))
    device: str = word("", "path of a serial port or SPI device; the usual one of the port where empty")
    counter_rate_hz: float = number(
        0.0, "Hz", "measured updates of a Wombat's counters; 0: usual for its firmware", Bounds(0.0, 1000.0)
    )


@dataclass(frozen=True, slots=True)
class BatteryConfig:
    """`[battery]`: the pack, and the voltages a match is planned for."""

    chemistry: str = word("lifepo4", "of the cells", ("lifepo4", "lipo", "nimh"))
    cells: float = number(2.0, "", "in series", Bounds(1.0, 12.0))
    weakest: float = number(6.1, "V", "lowest voltage of a match: no motion is planned faster", POSITIVE)
    tuned_at: Measured | None = optional("V", "resting voltage the program was tuned at", POSITIVE)


@dataclass(frozen=True, slots=True)
class DriveConfig:
    """`[drive]`: the two driven wheels."""

    left: int = port(0, "motor port of the left wheel", MOTOR_PORTS)
    right: int = port(1, "motor port of the right wheel", MOTOR_PORTS)


@dataclass(frozen=True, slots=True)
class MotorConfig:
    """`[motor.N]`: wiring and calibration of one motor port."""

    inverted: bool = switch(False, "true where positive duty turns the wheel backwards")
    radians_per_tick: Measured | None = optional(
        "rad", "wheel angle of one tick of the position counter; derived from the model when absent", POSITIVE
    )
    bemf_offset: Measured | None = optional("counts", "back-EMF reading at standstill", Bounds(-400.0, 400.0))
    power_factor: Measured = measured(
        1.0, 0.0, "", "static compensation k: the duty of this motor is multiplied by it", Bounds(0.5, 1.5)
    )
    static_voltage: Measured | None = optional(
        "V", "that friction takes at any speed; derived from the model when absent", NOT_NEGATIVE
    )
    speed_voltage: Measured | None = optional(
        "V/(rad/s)", "that a unit of wheel speed takes; derived from the model when absent", POSITIVE
    )
    acceleration_voltage: Measured | None = optional(
        "V/(rad/s2)", "that a unit of acceleration takes; derived from the model when absent", POSITIVE
    )


@dataclass(frozen=True, slots=True)
class TophatConfig:
    """`[tophat.NAME]`: one reflectance sensor and where it sits."""

    analog: int = port(0, "analog port", ANALOG_PORTS)
    forward: float = number(0.11, "m", "ahead of the wheel axis", Bounds(-1.0, 1.0))
    left: float = number(0.0, "m", "to the left of the middle", Bounds(-1.0, 1.0))


PULSES = Bounds(SERVO_PULSE_US[0], SERVO_PULSE_US[1])


@dataclass(frozen=True, slots=True)
class ServoConfig:
    """`[servo.NAME]`: one servo, its mechanical range and the places a program calls by name."""

    port: int = port(0, "servo port", SERVO_PORTS)
    lowest_us: float = number(600.0, "us", "shortest pulse the mechanism stands", PULSES)
    highest_us: float = number(2400.0, "us", "longest pulse the mechanism stands", PULSES)
    speed_us: float = number(3000.0, "us/s", "how fast the loaded servo turns, as change of pulse", POSITIVE)
    positions_us: Mapping[str, float] = named("us", "names for pulses, such as { open = 1200 }", PULSES)

    def __post_init__(self) -> None:
        if self.lowest_us >= self.highest_us:
            raise ConfigError(
                f"lowest_us = {self.lowest_us:g}: it must be below highest_us = {self.highest_us:g}"
            )
        for name, pulse in self.positions_us.items():
            if not self.lowest_us <= pulse <= self.highest_us:
                raise ConfigError(
                    f"positions_us.{name} = {pulse:g}: allowed are numbers from {self.lowest_us:g} to"
                    f" {self.highest_us:g}"
                )


@dataclass(frozen=True, slots=True)
class MechanismConfig:
    """`[mechanism.NAME]`: an arm or a gripper on a motor of its own, beside the drive."""

    motor: int = port(2, "motor port", MOTOR_PORTS)
    speed: float = number(3.0, "rad/s", "of moves", POSITIVE)
    acceleration: float = number(20.0, "rad/s2", "of moves", POSITIVE)
    inertia: float = number(0.01, "kg m2", "that the motor feels", POSITIVE)
    tolerance: float = number(0.03, "rad", "a move ends this near its goal", POSITIVE)


@dataclass(frozen=True, slots=True)
class MotionConfig:
    """`[motion]`: how fast the robot moves unless a motion says otherwise, and how closely it ends."""

    speed: float = number(0.15, "m/s", "of straight motions", POSITIVE)
    acceleration: float = number(0.4, "m/s2", "of straight motions", POSITIVE)
    turn_rate: float = number(1.5, "rad/s", "of turns", POSITIVE)
    turn_acceleration: float = number(6.0, "rad/s2", "of turns", POSITIVE)
    jerk: float = number(0.0, "m/s3", "of straight motions; 0 is no limit", NOT_NEGATIVE)
    turn_jerk: float = number(0.0, "rad/s3", "of turns; 0 is no limit", NOT_NEGATIVE)
    distance_tolerance: float = number(0.001, "m", "a straight motion ends this near its goal", POSITIVE)
    heading_tolerance: float = number(0.002, "rad", "a turn ends this near its goal", POSITIVE)


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """A whole `robot.toml`. `RobotConfig()` is the robot of the documentation."""

    name: str = "robot"
    controller: ControllerConfig = field(default_factory=ControllerConfig)
    battery: BatteryConfig = field(default_factory=BatteryConfig)
    drive: DriveConfig = field(default_factory=DriveConfig)
    motors: Mapping[int, MotorConfig] = field(default_factory=dict)
    tophats: Mapping[str, TophatConfig] = field(default_factory=dict)
    servos: Mapping[str, ServoConfig] = field(default_factory=dict)
    mechanisms: Mapping[str, MechanismConfig] = field(default_factory=dict)
    motion: MotionConfig = field(default_factory=MotionConfig)
    model: NominalModel = field(default_factory=NominalModel)

    def __post_init__(self) -> None:
        if self.drive.left == self.drive.right:
            raise ConfigError(
                f"drive.left and drive.right are both motor port {self.drive.left}: they must differ"
            )

        for name, each in self.mechanisms.items():
            if each.motor in (self.drive.left, self.drive.right):
                raise ConfigError(f"mechanism.{name}.motor = {each.motor}: the drive is on that port")

    def motor(self, motor_port: int) -> MotorConfig:
        """The configuration of a motor port, the default where the file says nothing."""
        return self.motors.get(motor_port, MotorConfig())


def load_robot(path: str | Path) -> RobotConfig:
    """Read a `robot.toml`.

    Raises ConfigError naming file, key, value and what is allowed; FileNotFoundError where there is no file.
    """
    path = Path(path)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not a TOML file: {error}") from error
    try:
        return parse_robot(table)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def parse_robot(table: Mapping[str, Any]) -> RobotConfig:
    """Make a robot from the tables of a `robot.toml`.

    Raises ConfigError naming key, value and what is allowed.
    """
    known = (
        "name",
        "controller",
        "battery",
        "drive",
        "motor",
        "tophat",
        "servo",
        "mechanism",
        "motion",
        "model",
    )
    refuse_unknown(table, known, "")
    name = table.get("name", "robot")
    if not isinstance(name, str):
        raise ConfigError(f"name = {name!r}: it must be a text")
    tophats = _named(table, "tophat", TophatConfig, "analog")
    servos = _named(table, "servo", ServoConfig, "port")
    mechanisms = _named(table, "mechanism", MechanismConfig, "motor")
    return RobotConfig(
        name=name,
        controller=section(ControllerConfig, table.get("controller", {}), "controller"),
        battery=section(BatteryConfig, table.get("battery", {}), "battery"),
        drive=section(DriveConfig, table.get("drive", {}), "drive"),
        motors={
            _motor_port(key): section(MotorConfig, entry, f"motor.{key}")
            for key, entry in subtable(table, "motor", "").items()
        },
        tophats=tophats,
        servos=servos,
        mechanisms=mechanisms,
        motion=section(MotionConfig, table.get("motion", {}), "motion"),
        model=parse_model(subtable(table, "model", "")),
    )


_SECTION_NOTES = {
    "motor.0": "  # one section a motor port, 0 to 3",
    "tophat.front": "  # one section a tophat, by any name",
    "servo.claw": "  # one section a servo, by any name",
    "mechanism.arm": "  # one section a motor that moves something else than the robot, by any name",
    "model.motor": "  # both motors; [model.motor.left] and [model.motor.right] override it",
}


def _named(table: Mapping[str, Any], group: str, kind: type[Any], port_key: str) -> dict[str, Any]:
    """The sections `[group.NAME]`; no two may sit on the same port."""
    users: dict[int, str] = {}
    found = {}
    for name, entry in subtable(table, group, "").items():
        where = f"{group}.{name}"
        found[name] = section(kind, entry, where)
        taken = getattr(found[name], port_key)
        if taken in users:
            raise ConfigError(f"{where}.{port_key} = {taken}: the port is taken by {users[taken]}")
        users[taken] = where
    return found


def _motor_port(key: str) -> int:
    if key not in {str(each) for each in range(MOTOR_PORTS)}:
        raise ConfigError(f"motor.{key}: allowed are the ports 0 to {MOTOR_PORTS - 1}")
    return int(key)


def template() -> str:
    """A `robot.toml` with every key, its default, unit, bounds and meaning; all commented out."""
    sections: tuple[tuple[str, type[Any]], ...] = (
        ("controller", ControllerConfig),
        ("battery", BatteryConfig),
        ("drive", DriveConfig),
        ("motor.0", MotorConfig),
        ("tophat.front", TophatConfig),
        ("servo.claw", ServoConfig),
        ("mechanism.arm", MechanismConfig),
        ("motion", MotionConfig),
        *((f"model.{key}", kind) for key, kind in MODEL_SECTIONS.items()),
    )
    lines = ['# name = "robot"']
    for name, kind in sections:
        lines += ["", f"[{name}]{_SECTION_NOTES.get(name, '')}"]
        lines += [template_line(each) for each in fields(kind)]
    return "\n".join(lines) + "\n"
