"""The configuration of a robot, `robot.toml`.

Every key is optional; unknown keys and impossible values are refused. The dataclasses of `sections` and
`nominal` are the only description of the file; reading, checking and the reference page follow from them.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.core.files import near_program, read_bounded
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
from raccoon.core.readings import MOTOR_PORTS
from raccoon.core.schema import Measured, format_value, refuse_unknown, section, subtable, template_line
from raccoon.core.sections import (
    REAL_CONTROLLERS,
    BatteryConfig,
    BodyConfig,
    BumperConfig,
    ControllerConfig,
    DriveConfig,
    MechanismConfig,
    MotionConfig,
    MotorConfig,
    ServoConfig,
    TophatConfig,
)
from raccoon.core.toml_text import parse_toml

__all__ = [
    "REAL_CONTROLLERS",
    "BatteryConfig",
    "BatteryModel",
    "BemfModel",
    "BodyConfig",
    "BumperConfig",
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


_log = logging.getLogger("raccoon")


@dataclass(frozen=True, slots=True)
class RobotConfig:
    """A whole `robot.toml`. `RobotConfig()` is the robot of the documentation."""

    name: str = "robot"
    controller: ControllerConfig = field(default_factory=ControllerConfig)
    battery: BatteryConfig = field(default_factory=BatteryConfig)
    drive: DriveConfig = field(default_factory=DriveConfig)
    body: BodyConfig = field(default_factory=BodyConfig)
    motors: Mapping[int, MotorConfig] = field(default_factory=dict)
    tophats: Mapping[str, TophatConfig] = field(default_factory=dict)
    bumpers: Mapping[str, BumperConfig] = field(default_factory=dict)
    servos: Mapping[str, ServoConfig] = field(default_factory=dict)
    mechanisms: Mapping[str, MechanismConfig] = field(default_factory=dict)
    motion: MotionConfig = field(default_factory=MotionConfig)
    model: NominalModel = field(default_factory=NominalModel)

    def __post_init__(self) -> None:
        if self.drive.left == self.drive.right:
            raise ConfigError(
                f"drive.left and drive.right are both motor port {self.drive.left}: they must differ"
            )
        for name, bumper in self.bumpers.items():
            bumper.check_on(self.body, f"bumper.{name}")
        for name, each in self.mechanisms.items():
            if each.motor in (self.drive.left, self.drive.right):
                raise ConfigError(f"mechanism.{name}.motor = {each.motor}: the drive is on that port")

    def motor(self, motor_port: int) -> MotorConfig:
        """The configuration of a motor port; the default if the file has none."""
        return self.motors.get(motor_port, MotorConfig())

    def wheel_motor(self, side: str) -> MotorConfig:
        """The configuration of the motor that drives the "left" or the "right" wheel."""
        return self.motor(getattr(self.drive, side))


def load_robot(path: str | Path) -> RobotConfig:
    """Read a `robot.toml`, searched in the working directory and then beside the program.

    Allowed values that do not fit together are reported in the log "raccoon". Raises ConfigError naming file,
    key, value and what is allowed; FileNotFoundError if there is no file.
    """
    path = near_program(path)
    content = read_bounded(path)
    try:
        table = parse_toml(content)
        if is_model(table):
            raise ConfigError(
                "it is a model.toml, which --model of diagnose, excite and sweep takes; name a robot.toml"
            )
        robot = parse_robot(table)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    full = robot.model.battery.open_circuit_voltage.value
    if robot.battery.weakest > full:
        _log.warning(
            "%s: battery.weakest = %g V is above model.battery.open_circuit_voltage = %g V: motions are"
            " planned faster than such a battery drives; correct the one that is wrong",
            path,
            robot.battery.weakest,
            full,
        )
    return robot


def is_model(table: Mapping[str, Any]) -> bool:
    """Whether these are the tables of a model.toml: it has tables that no robot.toml has."""
    return not table.keys().isdisjoint(("chain", "effect", "provenance"))


_SINGLE: Mapping[str, type[Any]] = {
    "controller": ControllerConfig,
    "battery": BatteryConfig,
    "drive": DriveConfig,
    "body": BodyConfig,
    "motion": MotionConfig,
}
"""Sections that occur once, by name; the names are those of RobotConfig's fields."""
_SEVERAL = ("motor", "tophat", "bumper", "servo", "mechanism")
"""Groups of named sections, `[GROUP.NAME]`."""


def _refuse_misplaced(table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    """Raise ConfigError for a key above all sections or in a wrong one, naming its section."""
    kinds = {
        **_SINGLE,
        "motor.N": MotorConfig,
        **{f"model.{name}": kind for name, kind in MODEL_SECTIONS.items()},
    }
    keys = {name: tuple(each.name for each in fields(kind)) for name, kind in kinds.items()}
    sections = {name: table[name] for name in _SINGLE if isinstance(table.get(name), Mapping)}
    for where, entries in {"": table, **sections}.items():
        for key in entries:
            homes = [f"[{name}]" for name, own in keys.items() if key in own]
            if homes and key not in keys.get(where, known):
                place = f"{where}.{key}" if where else key
                raise ConfigError(f"{place}: it belongs below a line with its section, {' or '.join(homes)}")


def parse_robot(table: Mapping[str, Any], also: tuple[str, ...] = ()) -> RobotConfig:
    """Make a robot from the tables of a `robot.toml`.

    also: keys that the file may have besides, and that are not in `table`. Raises ConfigError naming key,
    value and what is allowed.
    """
    known = ("name", *_SINGLE, *_SEVERAL, "model")
    _refuse_misplaced(table, known)
    refuse_unknown(table, (*known, *also), "")
    name = table.get("name", "robot")
    if not isinstance(name, str):
        raise ConfigError(f"name = {format_value(name)}: it must be a text")
    return RobotConfig(
        name=name,
        **{key: section(kind, table.get(key, {}), key) for key, kind in _SINGLE.items()},
        motors={
            _motor_port(key): section(MotorConfig, entry, f"motor.{key}")
            for key, entry in subtable(table, "motor", "").items()
        },
        tophats=_parse_named(table, "tophat", TophatConfig, "analog"),
        bumpers=_parse_named(table, "bumper", BumperConfig, "digital"),
        servos=_parse_named(table, "servo", ServoConfig, "port"),
        mechanisms=_parse_named(table, "mechanism", MechanismConfig, "motor"),
        model=parse_model(subtable(table, "model", "")),
    )


_SECTION_NOTES = {
    "body": "  # the box around the wheels, for the walls of the simulator",
    "motor.0": "  # one section per motor port, 0 to 3",
    "tophat.front": "  # one section per tophat, with any name",
    "bumper.front": "  # one section per switch that walls and objects press, with any name",
    "servo.claw": "  # one section per servo, with any name",
    "mechanism.arm": "  # one section per motor that does not drive the robot, with any name",
    "model.motor": "  # both motors; [model.motor.left] and [model.motor.right] override it",
}


def _parse_named(table: Mapping[str, Any], group: str, kind: type[Any], port_key: str) -> dict[str, Any]:
    """The sections `[group.NAME]`; no two may use the same port."""
    users: dict[int, str] = {}
    found = {}
    for name, entry in subtable(table, group, "").items():
        where = f"{group}.{name}"
        if not isinstance(entry, Mapping):
            raise ConfigError(
                f"{where} = {format_value(entry)}: it must be in a section with the {group}'s name, "
                f"[{group}.NAME]"
            )
        found[name] = section(kind, entry, where)
        taken = getattr(found[name], port_key)
        if taken in users:
            raise ConfigError(f"{where}.{port_key} = {taken}: the port is taken by {users[taken]}")
        users[taken] = where
    return found


def _motor_port(key: str) -> int:
    if key not in {str(each) for each in range(MOTOR_PORTS)}:
        raise ConfigError(
            f"motor.{key}: allowed are the ports 0 to {MOTOR_PORTS - 1}, a section each, as in [motor.0]"
        )
    return int(key)


def template() -> str:
    """A `robot.toml` with every key, its default, unit, bounds and meaning; all commented out, with the
    headers of optional parts (each such section makes a tophat, bumper, servo or mechanism)."""
    sections: tuple[tuple[str, type[Any]], ...] = (
        ("controller", ControllerConfig),
        ("battery", BatteryConfig),
        ("drive", DriveConfig),
        ("body", BodyConfig),
        ("motor.0", MotorConfig),
        ("tophat.front", TophatConfig),
        ("bumper.front", BumperConfig),
        ("servo.claw", ServoConfig),
        ("mechanism.arm", MechanismConfig),
        ("motion", MotionConfig),
        *((f"model.{key}", kind) for key, kind in MODEL_SECTIONS.items()),
    )
    lines = ['# name = "robot"']
    for name, kind in sections:
        header = f"[{name}]{_SECTION_NOTES.get(name, '')}"
        owned = kind in (TophatConfig, BumperConfig, ServoConfig, MechanismConfig)
        lines += ["", f"# {header}; remove the # here and at the keys that you need" if owned else header]
        lines += [template_line(each) for each in fields(kind)]
    return "\n".join(lines) + "\n"
