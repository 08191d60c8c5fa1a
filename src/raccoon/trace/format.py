"""Traces in memory, and the reader of trace files, which trusts no input.

A trace is JSON Lines, gzipped when it is finished (docs/trace-format.md). It is read up to the first damage;
`Trace.damage` says where that is and what is wrong.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, cast

from raccoon.core.errors import TraceError
from raccoon.core.progress import REPORT_PERIOD_CYCLES, report
from raccoon.core.readings import Device, Inputs, Outputs
from raccoon.trace.decode import parse_cycle, parse_device, parse_line
from raccoon.trace.encode import Values
from raccoon.trace.file_hints import check_not_picture
from raccoon.trace.header import Header, parse_header
from raccoon.trace.record import recording_file

MAX_LINE_BYTES = 1 << 20
MAX_BYTES = 1 << 30
MAX_TICKS = 1_000_000
"""Most cycles that are read: 83 minutes at 200 Hz."""
SECOND_RECORDING_TEXT = (
    "the recording ends in this line, and another one seems to follow: put each into its own file"
)
WRONG_VALUE_TEXT = "the recording ends in this line, but some value before it may be wrong"


@dataclass(frozen=True, slots=True)
class Tick:
    """One cycle: its readings, commands and estimates.

    commands: in the order of writing; usually one. estimates: by name.
    """

    inputs: Inputs
    commands: tuple[Outputs, ...] = ()
    estimates: dict[str, Values] = field(default_factory=dict)

    @property
    def outputs(self) -> Outputs | None:
        """The command that held until the next cycle; None if the program wrote none."""
        return self.commands[-1] if self.commands else None


@dataclass(frozen=True, slots=True)
class Event:
    """A remark of a run. tick: number of the cycle, -1 before the first."""

    tick: int
    text: str


@dataclass(frozen=True, slots=True)
class Damage:
    """The first damage of a recording: line of the file (from 1), number of the first lost cycle, reason.

    unread: number of lines after it, which are not used.
    """

    line: int
    tick: int
    reason: str
    unread: int = 0

    def __str__(self) -> str:
        lost = f"; what comes after it is not used ({self.unread} lines)" if self.unread else ""
        return f"line {self.line}, tick {self.tick}: {self.reason}{lost}"


@dataclass(slots=True)
class Trace:
    """A recording. opening: commands before the first cycle. damage: None if there is none."""

    header: Header
    ticks: list[Tick] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    opening: tuple[Outputs, ...] = ()
    damage: Damage | None = None


def read_trace(path: str | Path, *, max_bytes: int = MAX_BYTES, max_ticks: int = MAX_TICKS) -> Trace:
    """Read a recording, gzipped or not, up to its end or its first damage.

    path: the file, or the name of the recording (`run` for `run.jsonl.gz`). max_bytes: largest size when
    unpacked. max_ticks: most cycles that are read. Raises TraceError if there is not even a header,
    FileNotFoundError if there is no file.
    """
    path = recording_file(path)
    with path.open("rb") as raw:
        packed = raw.read(2) == b"\x1f\x8b"
        raw.seek(0)
        stream = cast(IO[bytes], gzip.GzipFile(fileobj=raw)) if packed else raw
        try:
            return _Reader(stream, path.name, max_bytes, max_ticks).trace()
        except TraceError as error:
            raise TraceError(f"{path}: {error}") from None


class _NotUnpacked(TraceError):
    """The packed file is damaged or cut off: its content is not what was written."""


class _Reader:
    """Decodes the lines of a stream into a trace and counts them."""

    def __init__(self, stream: IO[bytes], name: str, max_bytes: int, max_ticks: int) -> None:
        self._name = name
        self._stream = stream
        self._max_bytes = max_bytes
        self._max_ticks = max_ticks
        self._line = 0
        self._device: Device | None = None

    def trace(self) -> Trace:
        lines = self._lines()
        first = b"{}"
        try:
            first = next(lines, first)
            check_not_picture(first)
            trace = Trace(parse_header(parse_line(first)))
        except TraceError as error:
            hint = "; it looks like CSV: name it .csv" if first.startswith(b"t,") else ""
            raise TraceError(f"line {max(self._line, 1)}: {error}{hint}") from None
        try:
            for line in lines:
                table = parse_line(line)
                if "end" in table:
                    trace.damage = self._end(table, len(trace.ticks)) or self._after(lines, len(trace.ticks))
                    return trace
                if "device" in table:
                    self._device = parse_device(table["device"])
                else:
                    self._cycle(table, trace)
            raise TraceError("the recording was not closed: it has no last line")
        except TraceError as error:
            place = self._line  # reading the rest changes the count
            trace.damage = Damage(place, len(trace.ticks), str(error), self._rest(lines))
            return trace

    def _after(self, lines: Iterator[bytes], ticks: int) -> Damage | None:
        """The damage after the last line, if any: a wrong checksum at the end of the packed file, or further
        lines."""
        place, whole = self._line, 0
        try:
            for _ in lines:
                whole += 1
        except _NotUnpacked as error:
            if whole == 0:
                return Damage(place, ticks, f"{WRONG_VALUE_TEXT}: {error}")
        except TraceError:  # the lines that follow are cut off
            pass
        return Damage(place, ticks, SECOND_RECORDING_TEXT, whole) if self._line > place else None

    def _rest(self, lines: Iterator[bytes]) -> int:
        """Number of complete lines after the damage, as far as they can be read."""
        count = 0
        try:
            for _ in lines:
                count += 1
        except TraceError:  # the end of what can be read, such as a cut
            pass
        return count

    def _lines(self) -> Iterator[bytes]:
        total = 0
        while line := self._next_line():
            self._line += 1
            total += len(line)
            if len(line) > MAX_LINE_BYTES:
                raise TraceError(f"the line is longer than {MAX_LINE_BYTES} bytes")
            if total > self._max_bytes:
                raise TraceError(f"the recording is longer than {self._max_bytes} bytes")
            if not line.endswith(b"\n"):
                raise TraceError("the file is cut off in this line")
            yield line

    def _next_line(self) -> bytes:
        try:
            return self._stream.readline(MAX_LINE_BYTES + 1)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            self._line += 1
            raise _NotUnpacked(f"the packed file is damaged: {error}") from None

    def _cycle(self, table: dict[str, Any], trace: Trace) -> None:
        cycle = parse_cycle(table, self._device)
        number = len(trace.ticks)
        if cycle.inputs is None:
            if number:
                raise TraceError("t is missing")
            trace.opening += cycle.commands
            trace.events += [Event(-1, text) for text in cycle.events]
            return
        if number >= self._max_ticks:
            raise TraceError(f"more than {self._max_ticks} cycles")
        if number and cycle.inputs.time < trace.ticks[-1].inputs.time:
            raise TraceError(f"t is {cycle.inputs.time}: it goes back from {trace.ticks[-1].inputs.time}")
        if number and number % REPORT_PERIOD_CYCLES == 0:
            report(f"reading {self._name}: {number} cycles")
        trace.ticks.append(Tick(cycle.inputs, cycle.commands, dict(cycle.estimates)))
        trace.events += [Event(number, text) for text in cycle.events]

    def _end(self, table: dict[str, Any], ticks: int) -> Damage | None:
        """The damage that the last line reports: why the recording ended early; None if it did not."""
        if table["end"] != ticks:
            raise TraceError(f"the last line counts {table['end']!r} cycles and there are {ticks}")
        failure = table.get("failure")
        return None if failure is None else Damage(self._line, ticks, str(failure))
