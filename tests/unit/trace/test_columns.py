import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raccoon.core.errors import TraceError
from raccoon.core.readings import SI_WORDS, SIMULATOR, Fault, Inputs, Outputs, Truth
from raccoon.trace.columns import cycles_of, inputs_of, recording_of, trace_of
from raccoon.trace.format import Damage, Event, Tick, Trace, read_trace
from raccoon.trace.header import Header
from raccoon.trace.recording import Recording
from raccoon.trace.replay import ReplayPort
from unit.trace.recordings import command, cycle, record

T = np.array([0.0, 0.1])


def test_words_become_si_under_the_names_of_the_format() -> None:
    inputs = cycle(
        3,
        accel=(1, 2, 8192),
        analog=(180, None, None, None, None, None),
        digital=(True, False) + (None,) * 8,
        faults=(Fault.STALE,),
        truth=Truth(0.1, -0.2, 7.5, (True, None, False)),
        extra={"motor.0.current": 0.15},
    )
    recording = recording_of(Trace(Header(), [Tick(inputs, (Outputs((0.5, -0.25, 0.0, 0.0)),))]))
    expected = {
        "t": 3 / 200, "motor.0.bemf": 103, "motor.1.bemf": 99.5, "motor.0.position": 3,
        "motor.1.position": -3,
        "imu.gyro.x": SIMULATOR.gyro_rad_s, "imu.gyro.y": -2 * SIMULATOR.gyro_rad_s,
        "imu.gyro.z": 303 * SIMULATOR.gyro_rad_s, "imu.accel.z": 9.80665, "analog.0": 180,
        "digital.0": 1, "digital.1": 0, "battery.voltage": 752 * SIMULATOR.battery_volts, "fault.stale": 1,
        "truth.x": 0.1, "truth.y": -0.2, "truth.heading": 7.5, "truth.surface.0": 1, "truth.surface.2": 0,
        "motor.0.current": 0.15, "motor.0.duty": 0.5, "motor.1.duty": -0.25,
    }  # fmt: skip
    assert {name: recording[name][0] for name in expected} == pytest.approx(expected, rel=1e-15)
    assert "analog.1" not in recording
    assert "motor.0.brake" not in recording


def test_a_recorded_run_gives_the_same_readings_in_si(tmp_path: Path) -> None:
    trace = read_trace(record(tmp_path / "run"))
    recording = recording_of(trace)
    for inputs, tick in zip(inputs_of(recording), trace.ticks, strict=True):
        assert inputs.turn_rate == tick.inputs.turn_rate
        assert inputs.battery_voltage == tick.inputs.battery_voltage
        assert (inputs.bemf, inputs.position) == (tick.inputs.bemf, tick.inputs.position)
    np.testing.assert_array_equal(recording["estimate.pose.1"], [number / 7 for number in range(5)])
    assert recording.problems == []
    told = recording_of(replace(trace, damage=Damage(9, 7, "cut off"))).problems
    assert told == ["line 9, tick 7: cut off"]


def test_columns_survive_a_trip_through_cycles() -> None:
    columns = {
        "t": T, "motor.0.bemf": [1.5, np.nan], "motor.1.duty": [0.1, -1.0], "motor.7.bemf": [1.0, 2.0],
        "imu.gyro.z": [np.nan, 0.3], "digital.9": [1.0, 0.0], "depth": [np.nan, 4.0],
        "fault.torn": [1.0, np.nan], "truth.x": [0.5, 0.6], "truth.y": [-0.5, 0.0],
        "truth.heading": [7.0, 7.1], "truth.surface.2": [np.nan, 1.0],
    }  # fmt: skip
    recording = Recording({name: np.array(column) for name, column in columns.items()})
    back = recording_of(trace_of(recording))
    for name, column in columns.items():
        np.testing.assert_array_equal(back[name], column, err_msg=name)


def test_an_absent_reading_is_none_and_never_zero() -> None:
    columns = {"t": T, "motor.0.bemf": np.array([np.nan, 2.0]), "imu.gyro.z": np.array([0.5, np.nan])}
    first, second = inputs_of(Recording(columns))
    assert first.bemf == (None,) * 4
    assert (first.gyro, first.accel) == ((0.0, 0.0, 0.5), None)
    assert (second.gyro, second.battery, second.truth, second.extra) == (None, None, None, None)
    assert second.bemf[0] == 2.0
    assert first.device == SI_WORDS


def test_a_vector_that_lacks_a_recorded_axis_is_no_reading() -> None:
    columns = {"t": T, "imu.accel.x": np.array([1.0, 2.0]), "imu.accel.y": np.array([np.nan, 3.0])}
    first, second = inputs_of(Recording(columns))
    assert first.accel is None
    assert second.accel == (2.0, 3.0, 0.0)


def test_rows_without_a_command_have_none() -> None:
    columns = {
        "t": T,
        "motor.0.duty": np.array([np.nan, 0.5]),
        "servo.2.pulse_us": np.array([np.nan, 1500.0]),
    }
    (_, first), (_, second) = cycles_of(Recording(columns))
    assert first == ()
    assert second == (Outputs((0.5, 0.0, 0.0, 0.0), servo_us=(None, None, 1500, None)),)


def test_a_recording_can_be_played_through_a_port(tmp_path: Path) -> None:
    recording = recording_of(read_trace(record(tmp_path / "run")))
    port = ReplayPort(trace_of(recording))
    assert port.read().bemf[0] == 100
    port.write(command(0))
    port.read()


def test_worth_of_a_position_tick_is_kept_and_must_not_change() -> None:
    stock = replace(SIMULATOR, position_counts_seconds=1.25)
    ticks = [Tick(Inputs(0.0, stock, position=(4, None, None, None)))]
    recording = recording_of(Trace(Header(), ticks))
    assert recording.device.position_counts_seconds == 1.25
    assert recording["motor.0.position"][0] == 4
    with pytest.raises(TraceError, match="size of a position tick changes"):
        recording_of(Trace(Header(), [*ticks, Tick(cycle(5))]))


def test_who_was_recorded_is_kept_where_it_is_one() -> None:
    own: dict[str, Any] = {
        "name": "wombat-stock",
        "bemf_lag": 0.0128,
        "bemf_dead_zone": 40.0,
        "driven_share": 0.76,
        "bemf_range": 2000.0,
    }
    stock = replace(SIMULATOR, **own)
    ticks = [Tick(Inputs(0.0, stock)), Tick(Inputs(0.1, stock))]
    device = recording_of(Trace(Header(), ticks)).device
    assert device == replace(SI_WORDS, **own)
    other = Tick(Inputs(0.2, replace(stock, bemf_lag=0.02)))
    assert recording_of(Trace(Header(), [*ticks, other])).device == SI_WORDS


def test_estimates_that_are_not_finite_are_blank() -> None:
    tick = Tick(cycle(0), estimates={"pose": (1.0, float("inf"), float("nan"))})
    recording = recording_of(Trace(Header(), [tick, Tick(cycle(1), estimates={"pose": (1.0, 2.0, 3.0)})]))
    np.testing.assert_array_equal(recording["estimate.pose.1"], [np.nan, 2.0])


def test_ten_minutes_of_a_trace_become_columns_in_little_memory() -> None:
    """A Wombat has 1 GB, and rows as tables took 4 kB each."""
    tick = Tick(cycle(0), (command(0),), {"pose": (1.0, 2.0, 3.0)})
    trace = Trace(Header(), [tick] * 800)
    recording_of(trace)  # names are made once
    tracemalloc.start()
    try:
        columns = recording_of(trace).columns
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 3 * sum(column.nbytes for column in columns.values())


def test_columns_that_come_later_or_end_sooner_are_blank_there() -> None:
    ticks = [Tick(replace(cycle(row), extra={str(row): 1.0})) for row in range(3)]
    columns = recording_of(Trace(Header(), ticks))
    for row in range(3):
        assert np.flatnonzero(np.isfinite(columns[str(row)])).tolist() == [row]


def test_an_empty_trace_is_an_empty_recording() -> None:
    recording = recording_of(Trace(Header(), events=[Event(-1, "nothing")]))
    assert len(recording) == 0
    assert list(inputs_of(recording)) == []


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"x": T}, "no column t; there are x"),
        ({"t": np.array([0.0, np.nan])}, "row 1: t is nan"),
        ({"t": np.array([0.2, 0.1])}, r"row 1: t is 0.1: it goes back from 0.2"),
        ({"t": T, "x": np.zeros(3)}, r"column x has shape \(3,\)"),
    ],
)
def test_impossible_columns_are_refused(columns: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(TraceError, match=message):
        Recording(columns)


def test_a_missing_column_is_named_with_those_that_exist() -> None:
    with pytest.raises(TraceError, match=r"no column motor\.0\.bemf; there are t"):
        Recording({"t": T})["motor.0.bemf"]


def test_the_ports_of_a_recording() -> None:
    names = ("motor.1.bemf", "motor.0.bemf", "motor.0.duty", "analog.3", "analog.x")
    columns = {"t": np.arange(4.0)} | {name: np.arange(4.0) for name in names}
    recording = Recording(columns)
    assert recording.ports("motor", "bemf") == [0, 1]
    assert recording.ports("analog") == [3]
    assert not recording.has_truth


def test_a_duty_holds_until_the_next_one_of_its_motor() -> None:
    """A logger may write a command where it changes, and leave the others blank."""
    left, right = [0.5, np.nan, np.nan, -0.5, np.nan], [np.nan, 0.4, np.nan, np.nan, 0.0]
    columns = {"t": np.arange(5.0), "motor.0.duty": np.array(left), "motor.1.duty": np.array(right)}
    commands = [found[0].duty[:2] if found else None for _, found in cycles_of(Recording(columns))]
    assert commands == [(0.5, 0.0), (0.5, 0.4), None, (-0.5, 0.4), (-0.5, 0.0)]


def test_a_brake_holds_as_long_as_the_duty_of_its_motor() -> None:
    columns = {
        "t": [0.0, 0.1, 0.2, 0.3],
        "motor.0.duty": [0.0, np.nan, np.nan, 0.0],
        "motor.0.brake": [1.0, np.nan, np.nan, np.nan],
        "motor.1.duty": [np.nan, 0.5, np.nan, np.nan],
        "servo.0.pulse_us": [np.nan, np.nan, 1500.0, np.nan],
    }
    recording = Recording({name: np.array(column) for name, column in columns.items()})
    brakes = [outputs.brake[0] for _, (outputs,) in cycles_of(recording)]
    assert brakes == [True, True, True, False]


def test_a_pulse_that_no_servo_takes_is_none() -> None:
    """Loggers write 0 for a servo that is off, or the 0 to 2047 of KIPR's library."""
    pulses = [0.0, 599.0, 600.0, 2400.0, 1e300, np.nan]
    columns = {"t": np.arange(6.0), "motor.0.duty": np.full(6, 0.5), "servo.1.pulse_us": np.array(pulses)}
    commands = [outputs.servo_us[1] for _, (outputs,) in cycles_of(Recording(columns))]
    assert commands == [None, None, 600, 2400, None, None]
