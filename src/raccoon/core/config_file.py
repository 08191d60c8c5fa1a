"""Writing of measured values into an existing `robot.toml`; the rest of it, with comments, stays as it was.

The file is edited as text, key by key, and read again. Only if its content is exactly the old one plus the
new values does it replace the file, atomically: a power cut leaves the old file or the new one. A byte order
mark and the line ends of Windows stay. Replaced values go into `robot.history.toml` beside it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from raccoon.core.config import Measured, parse_robot
from raccoon.core.errors import ConfigError
from raccoon.core.files import write_atomically
from raccoon.core.toml_text import BYTE_ORDER_MARK, parse_toml

_HEADER = re.compile(r"^\s*\[(?!\[)\s*(?P<name>[^\]]+?)\s*\]\s*(#.*)?$")
_ANY_HEADER = re.compile(r"^\s*\[")
_HEADER_TO_BE = re.compile(r"^\s*#\s*\[")
"""A commented-out header: the lines below it belong to it once somebody removes the #."""


def write_measured(
    path: str | Path, values: Mapping[str, Measured], *, day: date | None = None
) -> Path | None:
    """Set measured values, by dotted key (`motor.0.radians_per_tick`), in the robot.toml at `path`.

    day: date of values without one. Returns the file that replaced values went into, None if nothing was
    replaced. Raises FileNotFoundError if there is no file, ConfigError if the file, its history or a value is
    not allowed, or if a key is written in a form that cannot be edited; then nothing is changed.
    """
    path = Path(path).resolve()
    content = path.read_bytes()
    dated = {key: value if value.date else replace(value, date=day) for key, value in values.items()}
    try:
        table = parse_toml(content)
        changed = updated_text(content.decode("utf-8"), dated)
        parse_robot(parse_toml(changed))
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    old = {key: found for key in dated if (found := _find_value(table, key)) is not None}
    history = path.with_name(f"{path.stem}.history.toml") if old else None
    if history is not None:
        _append_history(history, old, day)
    write_atomically(path, changed)
    return history


def updated_text(text: str, values: Mapping[str, Measured]) -> str:
    """The text of a robot.toml with these values set.

    Raises ConfigError if a key is in a form that cannot be edited (inside another key's braces, dotted).
    """
    mark = BYTE_ORDER_MARK if text.startswith(BYTE_ORDER_MARK) else ""
    lines = text.removeprefix(mark).split("\n")
    end = "\r" if lines[0].endswith("\r") else ""
    if not lines[-1]:
        lines.pop()
    else:  # the last line has no line end
        lines[-1] += end
    expected = parse_toml(text)
    for key, value in values.items():
        table, _, name = key.rpartition(".")
        if not table:
            raise ConfigError(f"{key}: a measured value must be in a table, such as motor.0.radians_per_tick")
        _set_line(lines, table, name, formatted(value), end)
        _assign(expected, key, parse_toml(f"x = {formatted(value)}")["x"])
    result = mark + "\n".join(lines) + "\n"
    try:
        agrees = parse_toml(result) == expected
    except ConfigError:
        agrees = False
    if not agrees:
        names = ", ".join(values)
        raise ConfigError(
            f"{names}: the file is written in a form that cannot be edited; give each table its own [header]"
        )
    return result


def formatted(value: Measured) -> str:
    """A measured value in TOML."""
    parts = [f"value = {_number(value.value)}", f"std = {_number(value.std, 3)}"]
    if value.date is not None:
        parts.append(f"date = {value.date.isoformat()}")
    if value.battery_voltage is not None:
        parts.append(f"battery_voltage = {_number(value.battery_voltage, 4)}")
    return "{ " + ", ".join(parts) + " }"


def _number(value: float, digits: int = 8) -> str:
    """A float in a form that TOML reads as a float."""
    text = repr(float(f"{value:.{digits}g}"))
    return text if any(mark in text for mark in ".e") else f"{text}.0"


def _set_line(lines: list[str], table: str, name: str, value: str, line_end: str) -> None:
    """Replace the line of a key, or add one to its table, or add the table.

    line_end: characters before the line feed of an added line.
    """
    begin = _table_start(lines, table)
    if begin is None:
        if lines and lines[-1].strip():
            lines.append(line_end)
        lines += [f"[{table}]{line_end}", f"{name} = {value}{line_end}"]
        return
    end = next((n for n in range(begin, len(lines)) if _ANY_HEADER.match(lines[n])), len(lines))
    pattern = re.compile(rf"^(?P<start>\s*(?P<off>#\s*)?{re.escape(name)}\s*=\s*)(?P<rest>.*)$")
    found = {number: match for number in range(begin, end) if (match := pattern.match(lines[number]))}
    for number, match in found.items():
        if match["off"] is None:
            lines[number] = match["start"] + value + _comment(match["rest"])
            return
    own = range(begin, next((n for n in range(begin, end) if _HEADER_TO_BE.match(lines[n])), end))
    explained = [number for number in found if number in own]
    filled = [number for number in own if lines[number].strip()]
    lines.insert(max(explained or filled, default=begin - 1) + 1, f"{name} = {value}{line_end}")


def _table_start(lines: list[str], table: str) -> int | None:
    """Number of the line after a table's header."""
    wanted = table.replace(" ", "")
    for number, line in enumerate(lines):
        found = _HEADER.match(line)
        if found and found["name"].replace(" ", "").replace('"', "") == wanted:
            return number + 1
    return None


def _comment(rest: str) -> str:
    """The comment behind a value without text, and the line's end."""
    place = rest.find("#")
    return rest[len(rest.rstrip("\r")) :] if place < 0 else "   " + rest[place:]


def _assign(table: dict[str, Any], key: str, value: object) -> None:
    names = key.split(".")
    for name in names[:-1]:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            raise ConfigError(f"{key}: {name} is no table in the file")
    table[names[-1]] = value


def _find_value(table: Mapping[str, Any], key: str) -> Any:
    found: Any = table
    for name in key.split("."):
        if not isinstance(found, Mapping) or name not in found:
            return None
        found = found[name]
    return deepcopy(found)


def _append_history(path: Path, old: Mapping[str, Any], day: date | None) -> None:
    """Append the replaced values. Raises ConfigError if the file is not a history."""
    text = "# Values that a calibration replaced.\n"
    try:
        if path.exists():
            content = path.read_bytes()
            parse_toml(content)
            text = content.decode("utf-8")
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}; repair it or move it away") from None
    for key, value in old.items():
        text += f'\n[[replaced]]\nkey = "{key}"\n'
        if day is not None:
            text += f"on = {day.isoformat()}\n"
        text += f"was = {_inline(value)}\n"
    parse_toml(text)
    write_atomically(path, text)


def _inline(value: Any) -> str:
    """A number, or a table of numbers and dates, on one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {_inline(each)}" for name, each in value.items()) + " }"
    if isinstance(value, date):
        return value.isoformat()
    return repr(value)
