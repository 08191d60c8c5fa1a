"""A trace of format version 1 as it was once written: every later library must read it the same."""

import math
from datetime import date
from pathlib import Path

from raccoon.core.config import Measured
from raccoon.core.readings import Device, Fault, Inputs, Outputs, Truth
from raccoon.trace.columns import recording_of
from raccoon.trace.csv import read_csv
from raccoon.trace.format import Event, Tick, Trace, read_trace

FOLDER = Path(__file__).parent
DEVICE = Device("kept", 0.0033, 1.25, 0.001, 0.0012, 0.0089)


def golden() -> Trace:
    return read_trace(FOLDER / "trace_v1.jsonl")


def test_every_field_of_a_cycle() -> None:
    first, second = golden().ticks
    assert first == Tick(
        Inputs(
            time=12.345678901234567,
            device=DEVICE,
            bemf=(103, -99.5, None, 0),
            position=(4611686018427387904, -3, None, None),
            gyro=(1, -2, 303),
            accel=(0, 5, 8192),
            analog=(180, 2930.5, None, 0, 4095, 7),
            digital=(True, False) + (None,) * 8,
            battery=752,
            faults=(Fault.STALE, Fault.TORN),
            truth=Truth(0.1, -0.2, 7.5, (True, None, False)),
            extra={"motor.0.current": 0.15},
        ),
        (
            Outputs(
                (0.1, -1.0, 0.3333333333333333, 0.0), (True, False, False, True), (None, 1500, 600, 2400)
            ),
            Outputs(),
        ),
        {"drive": (0.1, -math.inf, 5e-324)},
    )
    assert first.inputs.device.bemf_lag is None
    assert second == Tick(Inputs(time=12.35, device=DEVICE))


def test_what_surrounds_the_cycles() -> None:
    trace = golden()
    assert trace.damage is None
    assert trace.opening == (Outputs((0.5, 0.0, 0.0, 0.0)),)
    assert trace.events == [Event(-1, "before the first cycle"), Event(0, "grün")]
    header = trace.header
    assert (header.port, header.seed, header.revision, header.version) == ("SimPort", 7, "0123abcd", 1)
    assert header.config is not None
    assert header.config.name == "drumbot"
    assert header.config.motor(1).inverted
    fitted = Measured(0.00388, 0.00004, date(2026, 3, 1), 6.7)
    assert header.config.motor(0).radians_per_tick == fitted


def test_its_columns_are_those_of_the_csv() -> None:
    recording, kept = recording_of(golden()), read_csv(FOLDER / "trace_v1.csv")
    assert kept.columns.keys() == recording.columns.keys()
    for name, column in recording.columns.items():
        assert column.tobytes() == kept[name].tobytes(), name
