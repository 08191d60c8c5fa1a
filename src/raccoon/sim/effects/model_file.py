"""`model.toml`: a simulated robot on disk. The keys of robot.toml, `[chain]`, and one `[[effect]]` each.

[[effect]]
id = "drive.wheel_radius"
where = "left"
parameters = { factor = 1.02 }

A diagnosis adds where the numbers come from: `std`, `source` and `probability` of each effect, and the table
`[provenance]` of the whole.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from datetime import date
from pathlib import Path
from typing import Any

from raccoon.core.config import RobotConfig, is_model, parse_robot
from raccoon.core.errors import ConfigError
from raccoon.core.files import read_bounded, write_atomically
from raccoon.core.schema import Measured, refuse_unknown, section
from raccoon.core.toml_text import parse_toml
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.provenance import UNKNOWN, Origin, Provenance

MODEL_KEYS = ("effect", "chain", "provenance")
"""Keys of a model beyond those of a robot.toml."""
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")
"""Characters that a string of TOML cannot contain unescaped."""


def load_model(path: str | Path, robot: RobotConfig | None = None) -> Parameters:
    """Read a `model.toml`.

    robot: gives the numbers for a file with effects alone; by default the default robot. Raises ConfigError
    naming file, key, value and what is allowed, also for a robot.toml, which has ports and wiring and nothing
    that only a model has.
    """
    path = Path(path)
    content = read_bounded(path)
    try:
        table = parse_toml(content)
        model = parse_model(table, robot)
        if not is_model(table) and not table.keys() <= {"name", "model"}:
            raise ConfigError(
                "it has neither [[effect]] nor [chain], so it is no model but a robot.toml: name a model, "
                "such as raccoon diagnose --save-model writes"
            )
        return model
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def parse_model(table: Mapping[str, Any], robot: RobotConfig | None = None) -> Parameters:
    """The simulated robot of the tables of a `model.toml`; robot as for `load_model`. Raises ConfigError."""
    rest = dict(table)
    chain = rest.pop("chain", {})
    effects = rest.pop("effect", [])
    provenance = section(Provenance, rest.pop("provenance", {}), "provenance")
    known = tuple(each.name for each in fields(Chain))
    if not isinstance(chain, Mapping):
        raise ConfigError(f"chain = {chain!r}: it must be a table")
    refuse_unknown(chain, known, "chain")
    if not (isinstance(effects, list) and all(isinstance(each, Mapping) for each in effects)):
        raise ConfigError("effect: write [[effect]], one for each effect")
    own = robot if robot is not None and not rest else parse_robot(rest, MODEL_KEYS)
    parameters = Parameters(robot=own, chain=Chain(**chain), provenance=provenance)
    for number, entry in enumerate(effects, start=1):
        try:
            parameters = _with_entry(parameters, entry)
        except ConfigError as error:
            raise ConfigError(f"effect number {number}: {error}") from None
    return parameters


def _with_entry(parameters: Parameters, entry: Mapping[str, Any]) -> Parameters:
    known = tuple(each.name for each in fields(Origin))
    refuse_unknown(entry, ("id", "where", "parameters", *known), "")
    if not isinstance(entry.get("id"), str):
        raise ConfigError('it has no id: write id = "..."')
    values = entry.get("parameters", {})
    if not isinstance(values, Mapping):
        raise ConfigError(f"parameters = {values!r}: write {{ name = value }}")
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"{entry['id']}: {name} = {value!r}: it must be a number")
    where = None if "where" not in entry else str(entry["where"])
    parameters = parameters.with_effect(entry["id"], where, **values)
    origin = {name: entry[name] for name in known if name in entry}
    if origin:
        parameters = parameters.with_origin(entry["id"], where, section(Origin, origin, entry["id"]))
    return parameters


def save_model(parameters: Parameters, path: str | Path) -> None:
    """Write a `model.toml`, whole or not at all."""
    write_atomically(Path(path), model_text(parameters))


def model_text(parameters: Parameters) -> str:
    """The text of a `model.toml`."""
    lines = [f"name = {_shown(parameters.robot.name)}"]
    for name, part in _sections(parameters.robot):
        lines += ["", f"[{name}]", *_entries(part)]
    lines += ["", "[chain]", *_entries(parameters.chain)]
    if parameters.provenance != UNKNOWN:
        lines += ["", "[provenance]", *_entries(parameters.provenance)]
    for (effect, where), values in parameters.effects.items():
        lines += ["", "[[effect]]", f"id = {_shown(effect)}"]
        if where is not None:
            lines.append(f"where = {_shown(where)}")
        lines.append(f"parameters = {_shown(values)}")
        if (effect, where) in parameters.origins:
            lines += _entries(parameters.origins[(effect, where)])
    return "\n".join(lines) + "\n"


def _sections(robot: RobotConfig) -> Iterator[tuple[str, Any]]:
    for each in fields(robot):
        value = getattr(robot, each.name)
        if isinstance(value, Mapping):  # motors, tophats, servos ...: one section each, in the singular
            for key, section in value.items():
                yield f"{each.name.removesuffix('s')}.{_key(str(key))}", section
        elif each.name == "model":
            for part in fields(value):
                side = f"motor.{part.name}" if part.name in ("left", "right") else part.name
                yield f"model.{side}", getattr(value, part.name)
        elif is_dataclass(value):
            yield each.name, value


def _entries(section: Any) -> list[str]:
    values = ((each.name, getattr(section, each.name)) for each in fields(section))
    return [f"{name} = {_shown(value)}" for name, value in values if value is not None]


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _shown(name)


def _shown(value: object) -> str:
    if isinstance(value, Measured):
        return f"{{ {', '.join(_entries(value))} }}"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(str(key))} = {_shown(each)}' for key, each in value.items())} }}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(_shown(each) for each in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, str):
        text = value.encode("utf-8", "replace").decode()  # of a file's name that is no text
        text = text.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + _CONTROL.sub(lambda it: f"\\u{ord(it[0]):04x}", text) + '"'
    return repr(float(value) if isinstance(value, float) else value)  # NumPy's floats show their type
