import json
import sys
from pathlib import Path

import numpy as np
import pytest

from raccoon.core.errors import ConfigError, TraceError
from raccoon.core.readings import SI_WORDS
from raccoon.trace import mcap as trace_mcap
from raccoon.trace.columns import recording_of
from raccoon.trace.csv import read_csv, write_csv
from raccoon.trace.encode import MAX_TEXT
from raccoon.trace.format import Event, read_trace
from raccoon.trace.mcap import read_mcap, write_mcap
from raccoon.trace.recording import Recording
from unit.trace.recordings import record

mcap_writer = pytest.importorskip("mcap.writer")


def saved(folder: Path, count: int = 5) -> tuple[Recording, Path]:
    recording = recording_of(read_trace(record(folder / "run", count)))
    recording.events = [Event(1, "said ü"), Event(1, "twice"), Event(3, "b")]
    write_mcap(recording, folder / "run.mcap")
    return recording, folder / "run.mcap"


def test_every_value_comes_back_bit_for_bit(tmp_path: Path) -> None:
    recording, path = saved(tmp_path)
    back = read_mcap(path)
    assert back.columns.keys() == recording.columns.keys()
    for name, column in recording.columns.items():
        np.testing.assert_array_equal(back[name], column, err_msg=name)
    assert back.events == recording.events
    assert back.problems == []
    assert [each.name for each in tmp_path.iterdir() if "part" in each.name] == []


def test_worth_of_a_tick_equal_times_and_negative_times_survive(tmp_path: Path) -> None:
    device = SI_WORDS.__class__("si", 1.0, 1.25, 1.0, 1.0, 1.0)
    columns = {"t": np.array([-0.1, 0.2, 0.2]), "depth": np.array([np.nan, 2.0, 3.0])}
    write_mcap(Recording(columns, device=device), tmp_path / "run.mcap")
    back = read_mcap(tmp_path / "run.mcap")
    assert back.device.position_counts_seconds == 1.25
    np.testing.assert_array_equal(back["t"], [-0.1, 0.2, 0.2])
    np.testing.assert_array_equal(back["depth"], [np.nan, 2.0, 3.0])


def test_an_infinite_value_is_refused_as_in_a_csv(tmp_path: Path) -> None:
    """It would be missing in the file, and nobody told."""
    with pytest.raises(TraceError, match=r"column x, row 1: -inf: allowed are finite numbers"):
        write_mcap(Recording({"t": np.arange(2.0), "x": np.array([0.0, -np.inf])}), tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []


def test_numbers_under_the_name_of_remarks_are_remarks_in_every_form(tmp_path: Path) -> None:
    columns = {"t": np.arange(3.0), "event": np.array([np.nan, 7.0, 0.5])}
    recording = Recording(columns, [Event(0, "start"), Event(2, "end")])
    write_mcap(recording, tmp_path / "run.mcap")
    write_csv(recording, tmp_path / "run.csv")
    asked = [Event(0, "start"), Event(1, "7"), Event(2, "end"), Event(2, "0.5")]
    assert read_mcap(tmp_path / "run.mcap").events == asked
    assert read_csv(tmp_path / "run.csv").events == [*asked[:2], Event(2, "end; 0.5")]


def test_a_topic_of_numbers_with_the_name_of_remarks_is_read(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = mcap_writer.Writer(file)
        writer.start()
        for topic, value in (("/speed", 1.5), ("/event", 3)):
            channel = writer.register_channel(topic, "json", 0)
            writer.add_message(channel, 10**9, json.dumps({"value": value}).encode(), 10**9)
        writer.finish()
    found = read_mcap(path)
    assert (list(found.columns), found.events) == (["speed", "t"], [Event(0, "3")])


def test_the_longest_remark_of_a_trace_comes_back(tmp_path: Path) -> None:
    recording = Recording({"t": np.arange(2.0)}, [Event(1, "\N{WORLD MAP}" * MAX_TEXT)])
    write_mcap(recording, tmp_path / "run.mcap")
    assert read_mcap(tmp_path / "run.mcap").events == recording.events


def test_times_that_are_no_seconds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match=r"t goes from 0 to 1\.7e\+18 s: .* is t in seconds\?"):
        write_mcap(Recording({"t": np.array([0.0, 1.7e18])}), tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []
    write_mcap(Recording({"t": np.array([0.0, 1.7e9])}), tmp_path / "run.mcap")  # the clock of a computer


def test_topics_are_the_column_names(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    _, path = saved(tmp_path)
    with path.open("rb") as file:
        found = {
            (channel.topic, json.loads(message.data)["value"])
            for _, channel, message in make_reader(file).iter_messages()
            if message.sequence == 2
        }
    assert ("motor.0.position", 2.0) in found
    assert ("t", 0.01) in found


def foreign(path: Path, messages: list[tuple[str, int, bytes]], encoding: str = "json") -> Path:
    with path.open("wb") as file:
        writer = mcap_writer.Writer(file)
        writer.start()
        channels = {topic: writer.register_channel(topic, encoding, 0) for topic, _, _ in messages}
        for number, (topic, stamp, data) in enumerate(messages):
            writer.add_message(channels[topic], stamp, data, stamp, number)
        writer.finish()
    return path


def test_files_of_others_become_rows_by_time(tmp_path: Path) -> None:
    messages = [
        ("/depth", 5, b'{"value": 1}'),
        ("speed", 5, b'{"value": 2.5}'),
        ("speed", 9, b'{"value": 3}'),
    ]
    recording = read_mcap(foreign(tmp_path / "x.mcap", messages))
    np.testing.assert_array_equal(recording["t"], [5e-9, 9e-9])
    np.testing.assert_array_equal(recording["depth"], [1.0, np.nan])
    np.testing.assert_array_equal(recording["speed"], [2.5, 3.0])


@pytest.mark.parametrize("data", [b"{}", b"[1]", b'{"value": "x"}', b"\xff", b'{"value": NaN}', b"[" * 5000])
def test_messages_without_a_number_are_reported(tmp_path: Path, data: bytes) -> None:
    recording = read_mcap(foreign(tmp_path / "x.mcap", [("a", 1, b'{"value": 1}'), ("b", 2, data)]))
    assert len(recording) == 1
    assert "topic b" in recording.problems[0]


def test_a_topic_of_something_else_is_said_once(tmp_path: Path) -> None:
    poses = [("pose", stamp, b'{"x": 1}') for stamp in range(300)]
    path = foreign(
        tmp_path / "x.mcap", [*poses, ("motor.0.duty", 400, b'{"value": 7}'), ("a", 5, b'{"value": 1}')]
    )
    assert read_mcap(path).problems == [
        "topic motor.0.duty: 7: allowed are numbers from -1 to 1 and blank",
        "topic pose: b'{\"x\": 1}' has no number as value, and 299 more of its messages",
    ]


def test_a_topic_that_is_no_json_is_named(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        writer = mcap_writer.Writer(file)
        writer.start()
        for topic, encoding, data in (("a", "json", b'{"value": 1}'), ("/scan", "cdr", b"\0\1")):
            writer.add_message(writer.register_channel(topic, encoding, 0), 1, data, 1, 0)
        writer.finish()
    assert read_mcap(path).problems == ["topic scan: left out, its messages are cdr and not json"]


def test_a_file_without_such_messages_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="no JSON message"):
        read_mcap(foreign(tmp_path / "x.mcap", [("a", 1, b"\x00\x01")], "cdr"))


def test_a_file_cut_off_anywhere_is_damage_and_nothing_else(tmp_path: Path) -> None:
    _, path = saved(tmp_path)
    whole = path.read_bytes()
    for length in range(0, len(whole), 97):
        path.write_bytes(whole[:length])
        try:
            problems = read_mcap(path).problems
        except TraceError as error:
            problems = [str(error)]
        assert "damaged" in problems[0]
        assert not problems[0].endswith(": ")


def test_a_wrong_byte_anywhere_is_damage_and_nothing_else(tmp_path: Path) -> None:
    recording, path = saved(tmp_path)
    whole = path.read_bytes()
    for place in range(0, len(whole), 61):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        try:
            back = read_mcap(path)
        except TraceError:
            continue
        assert back.problems or len(back) == len(recording)


def test_a_chunk_that_says_to_be_longer_than_any_memory_is_damage(tmp_path: Path) -> None:
    _, path = saved(tmp_path)
    whole = path.read_bytes()
    length = whole.index(b"zstd") + 4
    path.write_bytes(whole[:length] + b"\xff" * 8 + whole[length + 8 :])
    with pytest.raises(TraceError, match=r"run\.mcap: the MCAP file is damaged"):
        read_mcap(path)


@pytest.mark.parametrize("compression", ["ZSTD", "LZ4", "NONE"])
def test_chunks_are_bounded_whatever_they_say(
    tmp_path: Path, compression: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = mcap_writer.Writer(file, compression=mcap_writer.CompressionType[compression])
        writer.start()
        channel = writer.register_channel("a", "json", 0)
        for stamp in range(2000):
            writer.add_message(channel, stamp, b'{"value": 1}' + b" " * 500, stamp)
        writer.finish()
    assert len(read_mcap(tmp_path / "x.mcap")) == 2000
    monkeypatch.setattr(trace_mcap, "MAX_CHUNK", 100_000)
    with pytest.raises(TraceError, match=r"unpacks to more than 100000|exceeds limit 100000"):
        read_mcap(tmp_path / "x.mcap")


def test_without_the_package_the_message_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    with pytest.raises(ConfigError, match=r"pip install '\.\[view\]'"):
        write_mcap(Recording({"t": np.zeros(1)}), tmp_path / "x.mcap")


def test_a_value_that_its_column_does_not_allow_is_left_blank_and_said(tmp_path: Path) -> None:
    values = [("motor.0.duty", 1.5), ("digital.0", 2), ("truth.surface.0", 0.5), ("motor.0.bemf", 1.5)]
    messages = [(topic, 5, b'{"value": %g}' % value) for topic, value in values]
    found = read_mcap(foreign(tmp_path / "x.mcap", messages))
    assert found.columns.keys() == {"motor.0.bemf", "t"}
    assert found.problems == [
        "topic motor.0.duty: 1.5: allowed are numbers from -1 to 1 and blank",
        "topic digital.0: 2: allowed are 0, 1 and blank",
        "topic truth.surface.0: 0.5: allowed are black, white and blank",
    ]


def test_a_duty_in_another_unit_is_refused_as_that_of_a_csv_is(tmp_path: Path) -> None:
    messages = [("motor.0.duty", stamp, b'{"value": 80}') for stamp in range(20)]
    with pytest.raises(
        TraceError, match=r"beyond -1..1 in 20 of 20 rows and reaches 80: it looks like percent"
    ):
        read_mcap(foreign(tmp_path / "x.mcap", messages))


def test_a_whole_number_that_no_float_holds_is_left_out(tmp_path: Path) -> None:
    messages = [("depth", 5, b'{"value": %s}' % (b"9" * 400)), ("depth", 6, b'{"value": 3}')]
    found = read_mcap(foreign(tmp_path / "x.mcap", messages))
    np.testing.assert_array_equal(found["depth"], [3.0])
    assert "has no number as value" in found.problems[0]
