"""Encoding of a cycle as one line of JSON.

Floats are written by `repr`, so they read back bit for bit; integers stay integers. JSON has no NaN and no
infinity: a reading or a command that is neither a number nor None is refused, while an estimate that is
rightly infinite or undefined (the standard deviation of something never seen) is written as the text "inf",
"-inf" or "nan".
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any, NamedTuple

from raccoon.core.readings import Device, Inputs, Outputs

Values = tuple[float, ...]
MAX_TEXT = 10_000
"""Longest text that a reader accepts, characters."""


class Cycle(NamedTuple):
    """The contents of one cycle; `inputs` is None for what happened before the first reading."""

    inputs: Inputs | None
    commands: tuple[Outputs, ...] = ()
    estimates: tuple[tuple[str, Values], ...] = ()
    events: tuple[str, ...] = ()


def _plain_number(value: Any) -> Any:
    # NumPy's integers and booleans are not Python's; importing NumPy to test for them would be slow.
    if hasattr(value, "item"):
        return value.item()
    raise TypeError(f"{value!r} is neither a number nor None")


_ENCODER = json.JSONEncoder(
    allow_nan=False, check_circular=False, separators=(",", ":"), default=_plain_number
)


def json_line(table: dict[str, Any]) -> str:
    """A table as one line of JSON. Raises ValueError for NaN and infinity, TypeError for other values that
    JSON does not have."""
    return _ENCODER.encode(table) + "\n"


def device_line(device: Device) -> str:
    """The line of a device: the units of the words in the following cycles."""
    return json_line({"device": asdict(device)})


def cycle_line(cycle: Cycle) -> str:
    """The line of one cycle. Raises ValueError or TypeError naming the field that cannot be written."""
    table = cycle_table(cycle)
    try:
        return json_line(table)
    except ValueError:
        if "est" in table:
            table["est"] = {name: _spelled(values) for name, values in cycle.estimates}
        try:
            return json_line(table)
        except ValueError:
            raise ValueError(_refusal(table)) from None


def cycle_table(cycle: Cycle) -> dict[str, Any]:
    """The fields of one cycle that are present, as JSON values."""
    table = {} if cycle.inputs is None else _inputs(cycle.inputs)
    if cycle.commands:
        table |= _outputs(cycle.commands[0])
        if len(cycle.commands) > 1:
            table["more"] = [_outputs(each) for each in cycle.commands[1:]]
    if cycle.estimates:
        table["est"] = dict(cycle.estimates)
    if cycle.events:
        table["events"] = cycle.events
    return table


_BLANK = Inputs(0.0, Device("", 1.0, 1.0, 1.0, 1.0, 1.0))
_REST = Outputs()


def _inputs(inputs: Inputs) -> dict[str, Any]:
    table: dict[str, Any] = {"t": inputs.time}
    if inputs.bemf != _BLANK.bemf:
        table["bemf"] = inputs.bemf
    if inputs.position != _BLANK.position:
        table["position"] = inputs.position
    if inputs.gyro is not None:
        table["gyro"] = inputs.gyro
    if inputs.accel is not None:
        table["accel"] = inputs.accel
    if inputs.analog != _BLANK.analog:
        table["analog"] = inputs.analog
    if inputs.digital != _BLANK.digital:
        table["digital"] = inputs.digital
    if inputs.battery is not None:
        table["battery"] = inputs.battery
    if inputs.faults:
        table["faults"] = inputs.faults
    if inputs.truth is not None:
        truth = inputs.truth
        table["truth"] = (truth.x, truth.y, truth.heading)
        if truth.surface:
            table["surface"] = truth.surface
    if inputs.extra is not None:
        table["extra"] = dict(inputs.extra)
    return table


def _outputs(outputs: Outputs) -> dict[str, Any]:
    table: dict[str, Any] = {"duty": outputs.duty}
    if outputs.brake != _REST.brake:
        table["brake"] = outputs.brake
    if outputs.servo_us != _REST.servo_us:
        table["servo"] = outputs.servo_us
    return table


def _spelled(values: Values) -> list[float | str]:
    return [value if math.isfinite(value) else str(float(value)) for value in values]


def _refusal(table: dict[str, Any]) -> str:
    for field, value in table.items():
        try:
            json_line({field: value})
        except ValueError:
            return f"t = {table.get('t')}: {field} is {value!r}: allowed are finite numbers and None"
    return "a cycle cannot be written"
