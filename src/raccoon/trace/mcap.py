"""MCAP export and import, with the column names as topics (extra `view`).

One JSON message {"value": ...} a sample on the topic of its column, which Foxglove can plot directly; none
where the column is blank. The message time is `t` in nanoseconds; the exact float is on the topic `t`, and
the sequence number is the row.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from raccoon.core.errors import ConfigError, TraceError
from raccoon.core.extras import install
from raccoon.core.files import replacing
from raccoon.core.readings import SI_WORDS
from raccoon.trace.encode import MAX_TEXT
from raccoon.trace.format import Event
from raccoon.trace.recording import EVENT, Column, OutOfRangeDuties, Recording, allowed_values

if TYPE_CHECKING:
    from mcap.writer import Writer

MAX_CHUNK = 64 << 20
MAX_BYTES = 1 << 30
MAX_VALUES = 20_000_000
MAX_PROBLEMS = 100
MAX_MESSAGE = 12 * MAX_TEXT + 100
"""Largest message, bytes; a letter of a remark may take twelve."""
MAX_SECONDS = 1.8e10
"""Largest time, s: 64 bits of nanoseconds."""
_PROFILE = "raccoon"
_TICK = "position_counts_seconds"


def write_mcap(recording: Recording, path: str | Path) -> None:
    """Write a recording as MCAP; the file appears completely or not at all.

    Raises ConfigError if the package mcap is not installed, TraceError for times that MCAP cannot represent
    and for an infinite value.
    """
    recording.check_finite()
    with _installed():
        from mcap.writer import Writer

    with replacing(Path(path)) as file:
        writer = Writer(file)
        writer.start(profile=_PROFILE, library=_PROFILE)
        writer.add_metadata(_PROFILE, {_TICK: repr(recording.device.position_counts_seconds)})
        _write_rows(writer, recording)
        writer.finish()


@contextmanager
def _installed() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        raise ConfigError(f"MCAP files need the package mcap: {install('view')} ({error})") from None


def _schema(writer: Writer, kind: str) -> int:
    schema = {"type": "object", "properties": {"value": {"type": kind}}}
    return int(writer.register_schema(f"{_PROFILE}.{kind}", "jsonschema", json.dumps(schema).encode()))


def _write_rows(writer: Writer, recording: Recording) -> None:
    number, text = _schema(writer, "number"), _schema(writer, "string")
    topics = [
        (writer.register_channel(name, "json", number), column.tolist())
        for name, column in recording.columns.items()
    ]
    remarks = writer.register_channel(EVENT, "json", text)
    time = recording["t"]
    start = min(0.0, float(time[0])) if len(time) else 0.0  # message times cannot be negative
    if len(time) and not time[-1] - start < MAX_SECONDS:
        raise TraceError(
            f"t goes from {start:g} to {time[-1]:g} s: MCAP can store only {MAX_SECONDS:g} s "
            "after the start; is t in seconds?"
        )
    stamps = [round((each - start) * 1e9) for each in time.tolist()]
    for row, stamp in enumerate(stamps):
        for channel, values in topics:
            if math.isfinite(values[row]):
                data = b'{"value":%s}' % repr(values[row]).encode()
                writer.add_message(channel, stamp, data, stamp, row)
    for event in recording.events:
        data = json.dumps({"value": event.text}).encode()
        writer.add_message(remarks, stamps[event.tick], data, stamps[event.tick], event.tick)


def read_mcap(path: str | Path) -> Recording:
    """Read the JSON topics {"value": ...} of an MCAP file of any origin as columns.

    A damaged file is read up to the damage. The damage, and values that their column does not allow, are left
    out and listed in `Recording.problems`. Raises TraceError if nothing can be read, ConfigError if the
    package mcap is not installed.
    """
    path = Path(path)
    with _installed():
        import mcap.reader  # noqa: F401  # so that the message about the missing package comes first

    rows = _Rows()
    with path.open("rb") as file:
        try:
            for record in _records(file):
                rows.take(record)
        except TraceError as error:
            rows.problems.append(f"{path}: {error}")
    try:
        return rows.recording()
    except TraceError as error:
        raise TraceError("; ".join([f"{path}: {error}", *rows.problems[:3]])) from None


def _records(file: IO[bytes]) -> Iterator[Any]:
    """The records of the file and of its chunks. Raises TraceError for any damage."""
    from mcap.exceptions import McapError
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    total = 0
    try:
        reader = StreamReader(file, emit_chunks=True, record_size_limit=MAX_CHUNK)
        for record in reader.records:
            if not isinstance(record, Chunk):
                yield record
                continue
            data = _unpacked(record.compression, record.data)
            total += len(data)
            if total > MAX_BYTES:
                raise TraceError(f"the recording is longer than {MAX_BYTES} bytes")
            yield from breakup_chunk(replace(record, compression="", data=data), validate_crc=True)
    except (
        McapError,
        ValueError,
        ArithmeticError,
        LookupError,
        EOFError,
        RuntimeError,
        MemoryError,
        struct.error,
    ) as error:
        raise TraceError(f"the MCAP file is damaged: {str(error) or 'it ends too soon'}") from None


def _unpacked(compression: str, data: bytes) -> bytes:
    """Content of a chunk. The size that the chunk itself states is not trusted. Raises TraceError for a
    damaged or too large chunk."""
    if compression == "zstd":
        import zstandard

        try:
            unpacked: bytes = zstandard.ZstdDecompressor().stream_reader(BytesIO(data)).read(MAX_CHUNK + 1)
        except zstandard.ZstdError as error:
            raise TraceError(f"a chunk is damaged: {error}") from None
    elif compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        unpacked = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=MAX_CHUNK + 1)
    else:
        unpacked = data
    if len(unpacked) > MAX_CHUNK:
        raise TraceError(f"a chunk unpacks to more than {MAX_CHUNK} bytes")
    return unpacked


class _Rows:
    """Collects messages into rows: one row for each time and sequence number."""

    def __init__(self) -> None:
        self.problems: list[str] = []
        self._topics: dict[int, str] = {}
        self._rows: dict[tuple[int, int], dict[str, float]] = {}
        self._texts: list[tuple[tuple[int, int], str]] = []
        self._ours = False
        self._count = 0
        self._tick = 1.0
        self._out_of_range = OutOfRangeDuties()
        self._unread: dict[str, str] = {}  # encodings of topics that are not JSON
        self._numberless: dict[str, tuple[bytes, int]] = {}  # by topic: first message without a number, count

    def take(self, record: Any) -> None:
        from mcap.records import Channel, Header, Message, Metadata

        match record:
            case Header():
                self._ours = record.profile == _PROFILE
            case Metadata() if record.name == _PROFILE:
                self._tick = self._worth(record.metadata)
            case Channel() if record.message_encoding == "json":
                self._topics[record.id] = record.topic.lstrip("/")
            case Channel():
                self._unread[record.topic.lstrip("/")] = record.message_encoding
            case Message() if record.channel_id in self._topics:
                self._message(self._topics[record.channel_id], record)

    def _message(self, topic: str, message: Any) -> None:
        self._count += 1
        if self._count > MAX_VALUES:
            raise TraceError(f"more than {MAX_VALUES} messages")
        # Other programs number the messages by topic; only the time shows which belong together.
        key = (message.log_time, message.sequence if self._ours else 0)
        value = _value(message.data)
        if isinstance(value, str) and topic == EVENT:
            self._texts.append((key, value))
        elif not (isinstance(value, int | float) and math.isfinite(value)):
            first, count = self._numberless.get(topic, (message.data[:40], 0))
            self._numberless[topic] = first, count + 1
        else:
            self._number(topic, float(value), self._rows.setdefault(key, {}))

    def _number(self, topic: str, value: float, row: dict[str, float]) -> None:
        allowed = allowed_values(topic, value)
        if not allowed:
            row[topic] = value
            return
        self._report(f"topic {topic}: {value:g}: allowed are {allowed} and blank")
        self._out_of_range.add(topic, value)

    def _report(self, problem: str) -> None:
        if len(self.problems) < MAX_PROBLEMS:
            self.problems.append(problem)

    def _worth(self, metadata: dict[str, str]) -> float:
        try:
            worth = float(metadata.get(_TICK, "1"))
        except ValueError:
            worth = math.nan
        if not (math.isfinite(worth) and worth > 0.0):
            self.problems.append(f"{_TICK} is {metadata.get(_TICK)!r}: allowed are numbers above 0")
            return 1.0
        return worth

    def recording(self) -> Recording:
        for topic, encoding in self._unread.items():
            self._report(
                f"topic {topic}: left out, its messages are {encoding or 'of no encoding'} and not json"
            )
        for topic, (data, count) in self._numberless.items():  # once a topic: all its messages may be such
            others = f", and {count - 1} more of its messages" if count > 1 else ""
            self._report(f"topic {topic}: {data!r} has no number as value{others}")
        self._out_of_range.check(len(self._rows))
        keys = sorted(self._rows.keys() | {key for key, _ in self._texts})
        if not keys:
            raise TraceError('there is no JSON message {"value": ...} in it')
        names = dict.fromkeys(name for row in self._rows.values() for name in row) | {"t": None}
        columns = {name: self._column(name, keys) for name in names}
        index = {key: row for row, key in enumerate(keys)}
        events = [Event(index[key], text) for key, text in self._texts]
        device = replace(SI_WORDS, position_counts_seconds=self._tick)
        return Recording(columns, events, device, self.problems)

    def _column(self, name: str, keys: list[tuple[int, int]]) -> Column:
        rows = (self._rows.get(key, {}) for key in keys)
        if name == "t":
            pairs = zip(keys, rows, strict=True)
            return np.array([row.get("t", key[0] / 1e9) for key, row in pairs], np.float64)
        return np.array([row.get(name, math.nan) for row in rows], np.float64)


def _value(data: bytes) -> object:
    try:
        # An integer of hundreds of digits is beyond the range of a float: infinite, like 1e999.
        message = json.loads(data, parse_int=float) if len(data) <= MAX_MESSAGE else None
    except (ValueError, RecursionError):
        return None
    return message.get("value") if isinstance(message, dict) else None
