"""Decoding of a line of JSON into a cycle. The file is untrusted: type, size and range of every field are
checked."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, TypeGuard

from raccoon.core.errors import TraceError
from raccoon.core.readings import Device, Fault, Inputs, Outputs, Truth
from raccoon.core.schema import format_value
from raccoon.trace.encode import MAX_TEXT, Cycle, Values

MAX_PORTS = 64
MAX_ENTRIES = 1000
MAX_BRACKETS = 2000
LARGEST_INT = 2**63

_SPELLED = ("nan", "inf", "-inf")
_FIELDS = {
    "t", "bemf", "position", "gyro", "accel", "analog", "digital", "battery", "faults", "truth", "surface",
    "extra", "duty", "brake", "servo", "more", "est", "events",
}  # fmt: skip


def parse_line(line: bytes) -> dict[str, Any]:
    """The JSON table in a line. Raises TraceError for anything else."""
    # The parser is recursive: a line of nothing but brackets must not reach it.
    if line.count(b"[") + line.count(b"{") > MAX_BRACKETS:
        raise TraceError(f"more than {MAX_BRACKETS} brackets in one line")
    try:
        table = json.loads(line, parse_constant=_no_constant)
    except TraceError:
        raise
    except (ValueError, RecursionError) as error:
        raise TraceError(f"not JSON: {error}") from None
    if not isinstance(table, dict):
        raise TraceError(f"{format_value(table)} is not a table")
    return table


def _no_constant(name: str) -> float:
    raise TraceError(f"{name} is not JSON: allowed are finite numbers and null")


def parse_device(table: object) -> Device:
    """Check and build a device. Raises TraceError naming the field and its value."""
    if not isinstance(table, dict):
        raise TraceError(f"device is {format_value(table)}: it must be a table")
    scales = ("bemf_volts", "position_counts_seconds", "gyro_rad_s", "accel_m_s2", "battery_volts")
    for key in (*scales, "analog_full_scale"):
        if not (_is_number(table.get(key)) and table[key] > 0):
            raise TraceError(f"device.{key} is {format_value(table.get(key))}: allowed are numbers above 0")
    # Old recordings lack the following fields.
    lag, dead_zone = table.get("bemf_lag"), table.get("bemf_dead_zone", 0.0)
    for key, value in (("bemf_lag", 0.0 if lag is None else lag), ("bemf_dead_zone", dead_zone)):
        if not (_is_number(value) and value >= 0):
            raise TraceError(f"device.{key} is {format_value(value)}: allowed are numbers from 0")
    driven = table.get("driven_share", 1.0)
    if not (_is_number(driven) and 0.0 < driven <= 1.0):
        raise TraceError(
            f"device.driven_share is {format_value(driven)}: allowed are numbers above 0 up to 1"
        )
    most = table.get("bemf_range")
    if most is not None and not (_is_number(most) and most > 0):
        raise TraceError(f"device.bemf_range is {format_value(most)}: allowed are numbers above 0")
    return Device(
        _text(table.get("name"), "device.name"),
        **{key: float(table[key]) for key in scales},
        analog_full_scale=int(table["analog_full_scale"]),
        bemf_lag=None if lag is None else float(lag),
        bemf_dead_zone=float(dead_zone),
        driven_share=float(driven),
        bemf_range=None if most is None else float(most),
    )


def parse_cycle(table: dict[str, Any], device: Device | None) -> Cycle:
    """Check and build a cycle. Raises TraceError naming the field and its value."""
    for field in table:
        if field not in _FIELDS:
            raise TraceError(f"{format_value(field)}: there is no such field")
    return Cycle(
        inputs=_inputs(table, device) if "t" in table else None,
        commands=_commands(table),
        estimates=_estimates(table.get("est", {})),
        events=tuple(_text(each, "events") for each in _list(table.get("events", []), "events")),
    )


def _inputs(table: Mapping[str, Any], device: Device | None) -> Inputs:
    if device is None:
        raise TraceError(
            "a cycle comes before the line with device, which gives the scales of its raw values"
        )
    given: dict[str, Any] = {}
    for field in ("bemf", "position", "analog"):
        if field in table:
            given[field] = _row(table[field], field, _word)
    for field in ("gyro", "accel"):
        if field in table:
            given[field] = _vector(table[field], field)
    if "digital" in table:
        given["digital"] = _row(table["digital"], "digital", _flag)
    if "battery" in table:
        given["battery"] = _number(table["battery"], "battery")
    if "faults" in table:
        given["faults"] = tuple(_fault(each) for each in _list(table["faults"], "faults"))
    if "truth" in table:
        surface = _row(table.get("surface", []), "surface", _flag)
        x, y, heading = _vector(table["truth"], "truth")
        given["truth"] = Truth(x, y, heading, surface)
    if "extra" in table:
        given["extra"] = {
            _text(key, "extra"): _number(value, f"extra.{key}")
            for key, value in _entries(table["extra"], "extra")
        }
    return Inputs(_number(table["t"], "t"), device, **given)


def _commands(table: Mapping[str, Any]) -> tuple[Outputs, ...]:
    if "duty" not in table:
        return ()
    return (_outputs(table), *(_outputs(each) for each in _list(table.get("more", []), "more")))


def _outputs(table: object) -> Outputs:
    if not isinstance(table, dict) or "duty" not in table:
        raise TraceError(f"more is {format_value(table)}: each must be a table with duty")
    given: dict[str, Any] = {"duty": _row(table["duty"], "duty", _number)}
    if "brake" in table:
        given["brake"] = _row(table["brake"], "brake", _switch)
    if "servo" in table:
        given["servo_us"] = _row(table["servo"], "servo", _pulse)
    try:
        return Outputs(**given)
    except ValueError as error:
        raise TraceError(str(error)) from None


def _estimates(table: object) -> tuple[tuple[str, Values], ...]:
    return tuple(
        (_text(name, "est"), _row(values, f"est.{name}", _estimate))
        for name, values in _entries(table, "est")
    )


def _row(value: object, field: str, each: Callable[[object, str], Any]) -> tuple[Any, ...]:
    entries = _list(value, field, MAX_PORTS)
    try:
        return tuple([each(entry, field) for entry in entries])
    except TraceError:  # names are slow to make, and only a wrong entry needs one
        return tuple([each(entry, f"{field}[{index}]") for index, entry in enumerate(entries)])


def _vector(value: object, field: str) -> tuple[float, float, float]:
    row = _row(value, field, _number)
    if len(row) != 3:
        raise TraceError(f"{field} is {format_value(value)}: it must be three numbers")
    return row[0], row[1], row[2]


def _is_number(value: object) -> TypeGuard[float]:
    if type(value) is float:
        return math.isfinite(value)
    return type(value) is int and -LARGEST_INT <= value <= LARGEST_INT


def _number(value: object, field: str) -> float:
    if not _is_number(value):
        raise TraceError(f"{field} is {format_value(value)}: allowed are finite numbers")
    return value


def _word(value: object, field: str) -> float | None:
    return None if value is None else _number(value, field)


def _estimate(value: object, field: str) -> float:
    return float(value) if isinstance(value, str) and value in _SPELLED else _number(value, field)


def _flag(value: object, field: str) -> bool | None:
    return None if value is None else _switch(value, field)


def _switch(value: object, field: str) -> bool:
    if not isinstance(value, bool):
        raise TraceError(f"{field} is {format_value(value)}: allowed are true and false")
    return value


def _pulse(value: object, field: str) -> int | None:
    if value is not None and type(value) is not int:
        raise TraceError(f"{field} is {format_value(value)}: allowed are whole microseconds and null")
    return value


def _fault(value: object) -> Fault:
    try:
        return Fault(_text(value, "faults"))
    except ValueError:
        raise TraceError(f"faults holds {format_value(value)}: allowed are {', '.join(Fault)}") from None


def _text(value: object, field: str) -> str:
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        raise TraceError(
            f"{field} holds {format_value(value)}: allowed are texts of up to {MAX_TEXT} characters"
        )
    return value


def _list(value: object, field: str, longest: int = MAX_ENTRIES) -> list[Any]:
    if not isinstance(value, list) or len(value) > longest:
        raise TraceError(f"{field} is {format_value(value)}: it must be a list of up to {longest}")
    return value


def _entries(value: object, field: str) -> list[tuple[str, Any]]:
    if not isinstance(value, dict) or len(value) > MAX_ENTRIES:
        raise TraceError(f"{field} is {format_value(value)}: it must be a table of up to {MAX_ENTRIES}")
    return list(value.items())
