"""Conversion of raw words into columns and back.

Every conversion is a product with a scale of the device, so a column that is converted with `SI_WORDS`, whose
scales are 1, does not change.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import repeat

import numpy as np

from raccoon.core.errors import TraceError
from raccoon.core.progress import REPORT_PERIOD_CYCLES, report
from raccoon.core.readings import (
    ANALOG_PORTS,
    DIGITAL_PORTS,
    MOTOR_PORTS,
    SERVO_PORTS,
    SERVO_PULSE_US,
    SI_WORDS,
    Device,
    Fault,
    Inputs,
    Outputs,
    Truth,
    Vector,
)
from raccoon.trace.encode import Values
from raccoon.trace.format import Event, Tick, Trace
from raccoon.trace.header import Header
from raccoon.trace.recording import Recording

Row = dict[str, float]
_AXES = ("x", "y", "z")


def recording_of(trace: Trace) -> Recording:
    """The columns of a trace. Estimates become columns `estimate.NAME.0` ..., blank if not finite.

    Raises TraceError if the size of a position tick changes during the trace: no single device describes it.
    """
    found: dict[str, array[float]] = {}  # a dict for each row would take 4 KB each, and a Wombat has 1 GB
    for row, tick in enumerate(trace.ticks):
        if row and row % REPORT_PERIOD_CYCLES == 0:
            report(f"columns of {row} of {len(trace.ticks)} cycles")
        for name, value in tick_row(tick).items():
            column = found.setdefault(name, array("d"))
            column.extend(repeat(math.nan, row - len(column)))
            column.append(value)
    rows = len(trace.ticks)
    columns = {name: np.full(rows, np.nan) for name in found | {"t": None}}
    for name, column in found.items():
        columns[name][: len(column)] = column
    scales = {tick.inputs.device.position_counts_seconds for tick in trace.ticks} or {1.0}
    if len(scales) > 1:
        raise TraceError(
            f"the size of a position tick changes during the recording: "
            f"position_counts_seconds is {sorted(scales)}"
        )
    device = _device({tick.inputs.device for tick in trace.ticks}, scales.pop())
    events = [Event(max(event.tick, 0), event.text) for event in trace.events] if rows else []
    problems = [] if trace.damage is None else [str(trace.damage)]
    return Recording(columns, events, device, problems)


def _device(devices: set[Device], counts_seconds: float) -> Device:
    """A device of SI words; with a single recorded device it keeps that one's name, lag, dead zone, range and
    driven share. counts_seconds: size of a position tick."""
    words = replace(SI_WORDS, position_counts_seconds=counts_seconds)
    if len(devices) != 1:
        return words
    (own,) = devices
    return replace(
        words,
        name=own.name,
        bemf_lag=own.bemf_lag,
        bemf_dead_zone=own.bemf_dead_zone,
        driven_share=own.driven_share,
        bemf_range=own.bemf_range,
    )


def tick_row(tick: Tick) -> Row:
    """The values of a cycle by column name, in SI."""
    row = _reading_row(tick.inputs)
    if tick.outputs is not None:
        row |= _command_row(tick.outputs)
    for name, values in tick.estimates.items():
        finite = tuple([value if math.isfinite(value) else None for value in values])
        row |= _numbered(f"estimate.{name}.{{}}", finite)
    return row


def _reading_row(inputs: Inputs) -> Row:
    device = inputs.device
    row = {name: float(value) for name, value in (inputs.extra or {}).items()}
    row["t"] = float(inputs.time)
    row |= _numbered("motor.{}.bemf", inputs.bemf)
    row |= _numbered("motor.{}.position", inputs.position)
    for name, vector, scale in (
        ("gyro", inputs.gyro, device.gyro_rad_s),
        ("accel", inputs.accel, device.accel_m_s2),
    ):
        if vector is not None:
            row |= {f"imu.{name}.{axis}": word * scale for axis, word in zip(_AXES, vector, strict=True)}
    row |= _numbered("analog.{}", inputs.analog)
    row |= _numbered("digital.{}", inputs.digital)
    if inputs.battery_voltage is not None:
        row["battery.voltage"] = inputs.battery_voltage
    row |= {f"fault.{fault}": 1.0 for fault in inputs.faults}
    if inputs.truth is not None:
        truth = inputs.truth
        row |= {"truth.x": truth.x, "truth.y": truth.y, "truth.heading": truth.heading}
        row |= _numbered("truth.surface.{}", truth.surface)
    return row


def _command_row(outputs: Outputs) -> Row:
    row = _numbered("motor.{}.duty", outputs.duty)
    if any(outputs.brake):
        row |= _numbered("motor.{}.brake", outputs.brake)
    return row | _numbered("servo.{}.pulse_us", outputs.servo_us)


def _numbered(pattern: str, words: Values | tuple[float | None, ...]) -> Row:
    names = _names(pattern, len(words))
    return {name: float(word) for name, word in zip(names, words, strict=True) if word is not None}


@cache
def _names(pattern: str, count: int) -> tuple[str, ...]:
    return tuple(pattern.format(number) for number in range(count))


def trace_of(recording: Recording) -> Trace:
    """A recording as a trace, so that a port can replay it. Raises ValueError for a duty outside -1..1."""
    ticks = [Tick(inputs, commands) for inputs, commands in cycles_of(recording)]
    return Trace(Header("recording"), ticks, list(recording.events))


def inputs_of(recording: Recording) -> Iterator[Inputs]:
    """The readings of each row, in the words of the recording's device. Raises ValueError for a duty outside
    -1..1."""
    return (inputs for inputs, _ in cycles_of(recording))


def cycles_of(recording: Recording) -> Iterator[tuple[Inputs, tuple[Outputs, ...]]]:
    """Readings and commands of each row. A duty holds until the next one of its motor, and its brake with it.

    A gyro or accelerometer axis without a column is 0; a row that lacks one of the existing axes has no
    reading. Columns without a field in `Inputs` go to its `extra`. A pulse that no servo accepts (0, or ticks
    of another library) becomes None. Raises ValueError for a duty outside -1..1.
    """
    names = list(recording.columns)
    held = Outputs()
    for values in zip(*(recording.columns[name].tolist() for name in names), strict=True):
        # NaN is the only number that differs from itself.
        row = {name: value for name, value in zip(names, values, strict=True) if value == value}
        commands = _take_commands(row, held)
        held = commands[-1] if commands else held
        yield _take_inputs(row, recording), commands


def _take_inputs(row: Row, recording: Recording) -> Inputs:
    """The readings of a row; the values used are removed from it."""
    digital = _take(row, "digital.{}", DIGITAL_PORTS)
    return Inputs(
        time=row.pop("t"),
        device=recording.device,
        bemf=_take(row, "motor.{}.bemf", MOTOR_PORTS),
        position=_take(row, "motor.{}.position", MOTOR_PORTS),
        gyro=_take_vector(row, "gyro", recording),
        accel=_take_vector(row, "accel", recording),
        analog=_take(row, "analog.{}", ANALOG_PORTS),
        digital=tuple([None if value is None else value != 0.0 for value in digital]),
        battery=row.pop("battery.voltage", None),
        faults=tuple([fault for fault in Fault if row.pop(f"fault.{fault}", 0.0) != 0.0]),
        truth=_take_truth(row),
        extra=row or None,
    )


def _take(row: Row, pattern: str, ports: int) -> tuple[float | None, ...]:
    return tuple([row.pop(pattern.format(port), None) for port in range(ports)])


def _take_vector(row: Row, name: str, recording: Recording) -> Vector | None:
    axes = [f"imu.{name}.{axis}" for axis in _AXES]
    known = [axis for axis in axes if axis in recording.columns]
    if not known or any(axis not in row for axis in known):
        return None
    x, y, z = (row.pop(axis, 0.0) for axis in axes)
    return x, y, z


def _take_truth(row: Row) -> Truth | None:
    surface = _take(row, "truth.surface.{}", ANALOG_PORTS)
    if not {"truth.x", "truth.y", "truth.heading"} <= row.keys():
        return None
    black = tuple([None if value is None else value != 0.0 for value in surface])
    x, y, heading = (row.pop(f"truth.{name}") for name in ("x", "y", "heading"))
    return Truth(x, y, heading, black if any(value is not None for value in black) else ())


def _take_commands(row: Row, held: Outputs) -> tuple[Outputs, ...]:
    """The command of a row, or none. held: the command before it, which continues for motors that the row
    does not name."""
    duty = _take(row, "motor.{}.duty", MOTOR_PORTS)
    brake = _take(row, "motor.{}.brake", MOTOR_PORTS)
    servo = _take(row, "servo.{}.pulse_us", SERVO_PORTS)
    if all(word is None for word in (*duty, *servo)):
        return ()
    brakes = zip(held.brake, brake, duty, strict=True)
    return (
        Outputs(
            duty=tuple([old if new is None else new for old, new in zip(held.duty, duty, strict=True)]),
            brake=tuple([old if new is named is None else bool(new) for old, new, named in brakes]),
            servo_us=tuple([_pulse(value) for value in servo]),
        ),
    )


def _pulse(value: float | None) -> int | None:
    low, high = SERVO_PULSE_US
    return None if value is None or not low <= value <= high else int(value)
