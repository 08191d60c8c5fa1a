"""Description of configuration sections: fields with unit, bounds and meaning, and the checks that follow
from them.

A section is a frozen dataclass whose fields are made with `number`, `measured`, `optional`, `word`, `port`,
`switch` and `named`. Reading, checking and the reference page use only the fields.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from datetime import date, datetime
from typing import Any, get_args, get_origin, get_type_hints

from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean


@dataclass(frozen=True, slots=True)
class Measured:
    """A number with its standard deviation and, if it was fitted, the date and battery voltage of the
    measurement.

    std is 0 for a number that is assumed exact.
    """

    value: float
    std: float = 0.0
    date: date | None = None
    battery_voltage: float | None = None

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise ConfigError(f"value is {self.value}: it must be finite")
        if not (math.isfinite(self.std) and self.std >= 0.0):
            raise ConfigError(f"std is {self.std}: it must be 0 or more")


@dataclass(frozen=True, slots=True)
class Bounds:
    """Closed interval of the allowed values; `positive` also excludes 0, `or_zero` also allows it."""

    low: float = -math.inf
    high: float = math.inf
    positive: bool = False
    or_zero: bool = False

    def allows(self, value: float) -> bool:
        """Whether a value is allowed; NaN is not."""
        if self.or_zero and value == 0.0:
            return True
        return self.low <= value <= self.high and not (self.positive and value <= 0.0)

    def __str__(self) -> str:
        if self.or_zero:
            return f"0 and numbers from {self.low:g} to {self.high:g}"
        if self.positive and math.isinf(self.high):
            return "numbers above 0"
        if self.positive:
            return f"numbers above 0 up to {self.high:g}"
        if math.isinf(self.low) and math.isinf(self.high):
            return "any finite number"
        if math.isinf(self.high):
            return f"numbers from {self.low:g}"
        return f"numbers from {self.low:g} to {self.high:g}"


POSITIVE = Bounds(positive=True)
NOT_NEGATIVE = Bounds(0.0)
BATTERY_VOLTAGE = Bounds(3.1, 30.0)
"""V; at a lower voltage no controller runs, and no speed loop uses the reading."""


def number(default: float, unit: str, meaning: str, bounds: Bounds = Bounds()) -> Any:
    """Field for a plain number."""
    return field(default=default, metadata={"unit": unit, "meaning": meaning, "bounds": bounds})


def measured(value: float, std: float, unit: str, meaning: str, bounds: Bounds = Bounds()) -> Any:
    """Field for a number with a standard deviation (in the file: a number, or a table with value and std)."""
    return field(default=Measured(value, std), metadata={"unit": unit, "meaning": meaning, "bounds": bounds})


def optional(unit: str, meaning: str, bounds: Bounds = Bounds()) -> Any:
    """Field for a measured number that may be absent."""
    return field(default=None, metadata={"unit": unit, "meaning": meaning, "bounds": bounds})


def word(
    default: str, meaning: str, allowed: tuple[str, ...] = (), instead: Mapping[str, str] | None = None
) -> Any:
    """Field for a text, or for one of a few words. instead: hints for other words that people write."""
    return field(default=default, metadata={"meaning": meaning, "allowed": allowed, "instead": instead or {}})


def port(default: int, meaning: str, count: int) -> Any:
    """Field for a port number."""
    return field(default=default, metadata={"unit": "", "meaning": meaning, "bounds": Bounds(0, count - 1)})


def switch(default: bool, meaning: str) -> Any:
    """Field for true or false."""
    return field(default=default, metadata={"meaning": meaning})


def named(unit: str, meaning: str, bounds: Bounds) -> Any:
    """Field for numbers with names of the user's choice; none by default."""
    return field(default_factory=dict, metadata={"unit": unit, "meaning": meaning, "bounds": bounds})


LONGEST = 60
"""Maximum number of characters of a value in a message."""


def format_value(value: object) -> str:
    """A value as shown in a message, shortened."""
    try:
        text = repr(value)
    except ValueError:  # Python does not print integers of more than some thousand digits
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def section(kind: type[Any], entry: object, where: str) -> Any:
    """The section of class `kind` from a table; `where` is its name in messages. Raises ConfigError."""
    if not isinstance(entry, Mapping):
        raise ConfigError(f"{where} = {format_value(entry)}: it must be a table")
    known = {each.name: each for each in fields(kind)}
    refuse_unknown(entry, tuple(known), where)
    hints = get_type_hints(kind)
    values = {key: _value(known[key], hints[key], value, f"{where}.{key}") for key, value in entry.items()}
    try:
        return kind(**values)
    except ConfigError as error:  # values that do not fit together
        raise ConfigError(f"{where}.{error}") from None


def _value(spec: Field[Any], hint: Any, value: object, where: str) -> object:
    if hint is bool:
        if not isinstance(value, bool):
            raise ConfigError(f"{where} = {format_value(value)}: allowed are true and false")
        return value
    if hint is str:
        allowed = spec.metadata["allowed"]
        if not isinstance(value, str) or (allowed and value not in allowed):
            meant = spec.metadata["instead"].get(value, "") if isinstance(value, str) else ""
            raise ConfigError(
                f"{where} = {format_value(value)}: allowed is {' | '.join(allowed) or 'a text'}"
                + (f"; {meant}" if meant else did_you_mean(value, allowed))
            )
        return value
    bounds: Bounds = spec.metadata["bounds"]
    unit: str = spec.metadata["unit"]
    if hint is int:
        if isinstance(value, bool) or not isinstance(value, int) or not bounds.allows(value):
            ports = f"{bounds.low:.0f} to {bounds.high:.0f}"
            raise ConfigError(f"{where} = {format_value(value)}: allowed are the ports {ports}")
        return value
    if get_origin(hint) is Mapping:
        if not isinstance(value, Mapping):
            raise ConfigError(f"{where} = {format_value(value)}: it must be a table of numbers")
        return {key: _number(entry, bounds, unit, f"{where}.{key}") for key, entry in value.items()}
    if hint is Measured or Measured in get_args(hint):
        return _measured(value, bounds, unit, where)
    return _number(value, bounds, unit, where)


def finite_or_none(value: object) -> float | None:
    """A value of a file as a finite float; None if it is not a number, NaN, or too large."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        found = float(value)
    except OverflowError:  # an integer of hundreds of digits
        return None
    return found if math.isfinite(found) else None


def _number(value: object, bounds: Bounds, unit: str, where: str) -> float:
    found = finite_or_none(value)
    if found is None or not bounds.allows(found):
        raise ConfigError(f"{where} = {format_value(value)}: allowed are {bounds} {unit}".rstrip())
    return found


def _measured(value: object, bounds: Bounds, unit: str, where: str) -> Measured:
    if not isinstance(value, Mapping):
        return Measured(_number(value, bounds, unit, where))
    refuse_unknown(value, ("value", "std", "date", "battery_voltage"), where)
    if "value" not in value:
        raise ConfigError(f"{where} has no value: write {{ value = ..., std = ... }}")
    day = value.get("date")
    if isinstance(day, datetime):
        day = day.date()
    if day is not None and not isinstance(day, date):
        raise ConfigError(f"{where}.date = {format_value(day)}: it must be a date such as 2026-03-01")
    voltage = value.get("battery_voltage")
    return Measured(
        value=_number(value["value"], bounds, unit, f"{where}.value"),
        std=_number(value.get("std", 0.0), NOT_NEGATIVE, unit, f"{where}.std"),
        date=day,
        battery_voltage=None
        if voltage is None
        else _number(voltage, POSITIVE, "V", f"{where}.battery_voltage"),
    )


def subtable(table: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    """The table under `key`; empty if there is none. Raises ConfigError for anything else."""
    entry = table.get(key, {})
    if not isinstance(entry, Mapping):
        raise ConfigError(f"{where}{'.' if where else ''}{key} = {format_value(entry)}: it must be a table")
    return entry


def refuse_unknown(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    """Raise ConfigError for a key that is not among the known ones."""
    for key in table:
        if key not in known:
            prefix = f"{where}." if where else ""
            meant = did_you_mean(key, known)
            raise ConfigError(f"{prefix}{key}: there is no such key{meant}; allowed are {', '.join(known)}")


def template_line(spec: Field[Any]) -> str:
    """One commented-out line of a template: key, default, unit, meaning and bounds."""
    meta = spec.metadata
    allowed = meta.get("allowed")
    rule = " | ".join(allowed) if allowed else str(meta.get("bounds", ""))
    unit = f"{meta['unit']}, " if meta.get("unit") else ""
    line = f"# {spec.name} = {_default(spec.default)}".rstrip()
    return f"{line}  # {unit}{meta['meaning']}" + (f" ({rule})" if rule else "")


def _default(default: object) -> str:
    if isinstance(default, Measured):
        value = f"{default.value:g}"
        return f"{{ value = {value}, std = {default.std:g} }}" if default.std else value
    if isinstance(default, bool):
        return "true" if default else "false"
    if isinstance(default, str):
        return f'"{default}"'
    if default is MISSING:
        return "{}"
    return "" if default is None else str(default)
