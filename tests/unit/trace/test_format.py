import gzip
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from raccoon.core.errors import TraceError
from raccoon.trace import format as trace_format
from raccoon.trace.format import read_trace
from unit.trace.recordings import record

DEVICE = {
    "name": "d", "bemf_volts": 1.0, "position_counts_seconds": 1.0, "gyro_rad_s": 1.0, "accel_m_s2": 1.0,
    "battery_volts": 1.0, "analog_full_scale": 4095,
}  # fmt: skip
HEADER = b'{"format":"raccoon trace","version":1}\n'


def lines_of(path: Path) -> list[bytes]:
    return gzip.decompress(path.read_bytes()).splitlines(keepends=True)


def write(path: Path, *tables: Any) -> Path:
    path.write_bytes(HEADER + b"".join(json.dumps(table).encode() + b"\n" for table in tables))
    return path


def test_file_cut_off_anywhere_loses_the_cut_line_only(tmp_path: Path) -> None:
    lines = lines_of(record(tmp_path / "run", 3))
    whole = b"".join(lines)
    cut = tmp_path / "cut.jsonl"
    for length in range(len(lines[0]), len(whole), 3):
        cut.write_bytes(whole[:length])
        trace = read_trace(cut)
        complete = whole[:length].count(b"\n") - 2  # header and device
        assert len(trace.ticks) == max(complete, 0)
        assert trace.damage is not None
        assert trace.damage.tick == len(trace.ticks)


def test_packed_file_cut_off_is_read_up_to_the_damage(tmp_path: Path) -> None:
    path = record(tmp_path / "run", 400)
    path.write_bytes(path.read_bytes()[:-400])
    trace = read_trace(path)
    assert 0 < len(trace.ticks) < 400
    assert "packed file is damaged" in str(trace.damage)


def test_packed_file_with_a_wrong_byte_is_damaged_or_the_same(tmp_path: Path) -> None:
    path = record(tmp_path / "run", 400)
    right, written = path.read_bytes(), read_trace(path)
    header = 10  # of gzip: when and where it was packed
    for place in range(header, len(right), 611):
        data = bytearray(right)
        data[place] ^= 0xFF
        path.write_bytes(data)
        try:
            trace = read_trace(path)
        except TraceError:  # there is no header of a recording
            continue
        assert trace.damage is not None or trace == written


def test_a_packed_file_in_which_only_a_number_is_another_is_damaged(tmp_path: Path) -> None:
    """Nothing but the sum at its end tells: of 70 wrong bytes one was not seen."""
    path = record(tmp_path / "run", 20)
    packed = path.read_bytes()
    plain = gzip.decompress(packed)
    other = gzip.compress(plain.replace(b"0.30000000000000004", b"0.90000000000000002", 1))
    path.write_bytes(other[:-8] + packed[-8:])  # with the sum and length of what was written
    trace = read_trace(path)
    assert len(trace.ticks) == 20
    assert trace.damage is not None
    assert trace.damage.tick == 20
    assert "some value before it may be wrong" in str(trace.damage)


def test_a_second_recording_in_the_same_file_is_said(tmp_path: Path) -> None:
    """`cat one.jsonl.gz two.jsonl.gz`: it was left out without a word."""
    path = record(tmp_path / "run")
    once = read_trace(path)
    path.write_bytes(2 * path.read_bytes())
    twice = read_trace(path)
    assert twice.ticks == once.ticks
    assert once.damage is None
    assert twice.damage is not None
    assert twice.damage.unread == twice.damage.line
    assert "another one seems to follow" in str(twice.damage)


@pytest.mark.parametrize("cut", [20, 200])
@pytest.mark.parametrize("packed", [False, True])
def test_a_second_recording_that_is_cut_off_does_no_harm_to_the_first(
    tmp_path: Path, packed: bool, cut: int
) -> None:
    path = record(tmp_path / "run", 40)
    whole = path.read_bytes()
    both = whole + whole[:-cut] if packed else 2 * gzip.decompress(whole)
    path.write_bytes(both if packed else both[:-cut])
    damage = read_trace(path).damage
    assert damage is not None
    assert "another one seems to follow" in str(damage)
    assert "what was written" not in str(damage)


def test_how_much_comes_after_the_damage_is_said(tmp_path: Path) -> None:
    lines = lines_of(record(tmp_path / "run", 20))
    path = tmp_path / "bad.jsonl"
    path.write_bytes(b"".join([*lines[:8], b"oops\n", *lines[9:]]))
    trace = read_trace(path)
    assert trace.damage is not None
    assert (trace.damage.line, trace.damage.tick) == (9, 6)
    assert str(trace.damage).endswith(f"; what comes after it is not used ({len(lines) - 9} lines)")
    path.write_bytes(b"".join(lines[:8]) + b"oops")
    assert "not used" not in str(read_trace(path).damage)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "must say 'raccoon trace'"),
        (b"\n", "not JSON"),
        (b"[1]\n", "not a table"),
        (b"t,motor.0.duty\n", "not JSON.*; it looks like CSV: name it .csv"),
        (b"\x00\xff\xfe\n", "not JSON"),
        (b'{"format":"raccoon trace"', "cut off"),
        (b'{"format":"raccoon trace","version":99}\n', "version is 99"),
        (b'{"format":"raccoon trace","version":true}\n', "version is True"),
        (b'{"format":"raccoon trace","version":1,"seed":-1}\n', "seed is -1"),
        (b'{"format":"raccoon trace","version":1,"port":5}\n', "port is 5"),
        (b'{"format":"raccoon trace","version":1,"config":{"drive":{"left":9}}}\n', "drive.left = 9"),
        (b'{"format":"raccoon trace","version":1,"config":[]}\n', "must be the tables"),
        (b"[" * 100_000 + b"\n", "brackets"),
        (b'{"a":' * 100_000 + b"\n", "brackets"),
        (b"x" * 2_000_000, "longer than"),
    ],
)
def test_a_file_without_a_header_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.jsonl"
    path.write_bytes(content)
    with pytest.raises(TraceError, match=message):
        read_trace(path)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"t": "0"}, "t is '0'"),
        ({"t": True}, "t is True"),
        ({"t": None}, "t is None"),
        ({"t": 1, "bemf": 5}, "bemf is 5: it must be a list"),
        ({"t": 1, "bemf": [1, "2"]}, r"bemf\[1\] is '2'"),
        ({"t": 1, "bemf": [2**64]}, r"bemf\[0\] is 18446744073709551616"),
        ({"t": 1, "bemf": [0] * 65}, "list of up to 64"),
        ({"t": 1, "gyro": [1, 2]}, "gyro is .* three numbers"),
        ({"t": 1, "digital": [1]}, r"digital\[0\] is 1: allowed are true and false"),
        ({"t": 1, "battery": [6.6]}, "battery is"),
        ({"t": 1, "faults": ["fire"]}, "faults holds 'fire'"),
        ({"t": 1, "faults": [["x"]]}, "faults holds"),
        ({"t": 1, "truth": [0, 0, "n"]}, r"truth\[2\]"),
        ({"t": 1, "extra": {"x": "y"}}, "extra.x is 'y'"),
        ({"t": 1, "extra": [1]}, "extra is"),
        ({"t": 1, "duty": [2.0, 0, 0, 0]}, "duty of motor 0 is 2.0"),
        ({"t": 1, "duty": [0.0], "brake": [0]}, r"brake\[0\]"),
        ({"t": 1, "duty": [0.0], "servo": [1500.5]}, r"servo\[0\]"),
        ({"t": 1, "duty": [0.0]}, "1 duties, 4 brakes and 4 servos were given"),
        ({"t": 1, "duty": [0] * 4, "servo": [5, None, None, None]}, "pulse of servo 0"),
        ({"t": 1, "duty": [0] * 4, "more": [{"brake": []}]}, "more is"),
        ({"t": 1, "est": {"pose": ["zero"]}}, r"est.pose\[0\] is 'zero'"),
        ({"t": 1, "events": "x"}, "events is"),
        ({"t": 1, "events": [5]}, "events holds 5"),
        ({"t": 1, "__class__": "os.system"}, "no such field"),
        ({"duty": [0] * 4}, "t is missing"),
        ({"t": -1}, "it goes back"),
    ],
)
def test_a_wrong_field_is_damage_with_line_field_and_value(
    tmp_path: Path, fields: dict[str, Any], message: str
) -> None:
    path = write(tmp_path / "bad.jsonl", {"device": DEVICE}, {"t": 0.5}, fields, {"t": 2.0})
    trace = read_trace(path)
    assert len(trace.ticks) == 1
    assert trace.damage is not None
    assert (trace.damage.line, trace.damage.tick) == (4, 1)
    with pytest.raises(TraceError, match=message):
        raise TraceError(trace.damage.reason)


@pytest.mark.parametrize(
    "text", [b'{"t":NaN}', b'{"t":Infinity}', b'{"t":1e999}', b'{"t":' + b"9" * 5000 + b"}"]
)
def test_numbers_that_are_none_are_damage(tmp_path: Path, text: bytes) -> None:
    path = write(tmp_path / "bad.jsonl", {"device": DEVICE})
    path.write_bytes(path.read_bytes() + text + b"\n")
    trace = read_trace(path)
    assert trace.ticks == []
    assert trace.damage is not None
    assert trace.damage.line == 3


@pytest.mark.parametrize(
    "change",
    [
        {"bemf_volts": 0},
        {"bemf_volts": "1"},
        {"gyro_rad_s": -1},
        {"name": 5},
        {"battery_volts": None},
        {"bemf_lag": -0.1},
        {"bemf_dead_zone": None},
        {"driven_share": 0.0},
        {"driven_share": 1.1},
        {"bemf_range": 0.0},
        {"bemf_range": "all"},
    ],
)
def test_a_wrong_device_is_damage(tmp_path: Path, change: dict[str, Any]) -> None:
    trace = read_trace(write(tmp_path / "bad.jsonl", {"device": DEVICE | change}, {"t": 0}))
    assert "device." in str(trace.damage)
    assert trace.ticks == []


def test_a_cycle_before_its_device_is_damage(tmp_path: Path) -> None:
    assert "before the line with device" in str(read_trace(write(tmp_path / "bad.jsonl", {"t": 0})).damage)


def test_a_wrong_count_at_the_end_is_damage(tmp_path: Path) -> None:
    trace = read_trace(write(tmp_path / "bad.jsonl", {"device": DEVICE}, {"t": 0}, {"end": 5}))
    assert "counts 5 cycles and there are 1" in str(trace.damage)


def test_a_bomb_is_read_up_to_the_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bomb.jsonl.gz"
    with gzip.open(path, "wb") as file:
        file.write(HEADER + json.dumps({"device": DEVICE}).encode() + b"\n" + b'{"t":1}\n' * 50_000)
    assert "more than 1000 cycles" in str(read_trace(path, max_ticks=1000).damage)
    assert "longer than 10000 bytes" in str(read_trace(path, max_bytes=10_000).damage)
    with gzip.open(path, "wb") as file:
        file.write(HEADER)
        file.write(b" " * 50_000_000)
    assert "line is longer" in str(read_trace(path).damage)
    monkeypatch.setattr(trace_format, "MAX_LINE_BYTES", 10)
    with pytest.raises(TraceError, match="line is longer than 10"):
        read_trace(path)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(position=st.integers(0, 900), junk=st.binary(min_size=1, max_size=12))
def test_damage_of_any_kind_is_said_and_never_anything_else(
    tmp_path: Path, position: int, junk: bytes
) -> None:
    whole = b"".join(lines_of(record_once(tmp_path)))
    path = tmp_path / "junk.jsonl"
    path.write_bytes(whole[:position] + junk + whole[position + len(junk) :])
    try:
        trace = read_trace(path)
    except TraceError:
        return
    assert len(trace.ticks) <= 3


def record_once(folder: Path) -> Path:
    path = folder / "once.jsonl.gz"
    return path if path.exists() else record(path, 3)
