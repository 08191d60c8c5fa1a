"""The CSV interchange format: one row a sample, blank if a sensor gave nothing new (docs/trace-format.md).

Numbers are written in the shortest form that reads back as the same float. Unknown columns are kept.
"""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from pathlib import Path
from typing import IO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.core.files import replacing
from raccoon.trace.csv_header import read_header
from raccoon.trace.csv_rows import CsvRows
from raccoon.trace.file_hints import find_csv_separator, not_a_number_hint
from raccoon.trace.format import Event
from raccoon.trace.recording import EVENT, SURFACE, OutOfRangeDuties, Recording, allowed_values
from raccoon.trace.time_order import TimeOrder, TimeStep

MAX_BYTES = 1 << 30
MAX_CELLS = 50_000_000
MAX_PROBLEMS = 1000
TIME_ALLOWED = "allowed are numbers that do not go back"
_COLORS = {"black": 1.0, "white": 0.0}
_FORMAT_COLUMN = re.compile(r"t|(motor|servo|battery|imu|analog|digital|truth|fault|estimate)\..+")
"""Columns of the format. Other columns are kept if they contain numbers."""
BLANK_WORDS = ("nan", "-nan", "na", "n/a", "#n/a", "null", "none")
"""Texts that programs write for a blank."""
MAX_WORDS_LISTED = 10
"""Most lines without a number in a column outside the format that are reported one by one."""
Columns: TypeAlias = "dict[str, array[float]]"
_ORDER = ("t", "motor", "servo", "battery", "imu", "analog", "digital", "truth")


def read_csv(path: str | Path, *, strict: bool = True) -> Recording:
    """Read a recording from CSV.

    strict: raise TraceError at the first bad row or value, naming line, column and value. Otherwise a bad
    value is blank, a bad row and a last row without an end are left out, and `Recording.problems` lists them;
    of texts for a blank, such as NaN, it lists the first in each column. A file without a usable header, too
    large or wrong almost everywhere raises TraceError in any case. A column outside the format that contains
    words is reported once. Semicolons or tabs may also separate the columns; then decimal commas are allowed,
    as spreadsheets write them in many countries.
    """
    path = Path(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise TraceError(f"the file has more than {MAX_BYTES} bytes")
        separator = find_csv_separator(path)
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            return _Reader(file, strict, separator).recording()
    except TraceError as error:
        raise TraceError(f"{path}: {error}") from None


class _Reader:
    def __init__(self, file: IO[str], strict: bool, separator: str) -> None:
        self._rows, self._separator = CsvRows(file, separator), separator
        self._commas = separator != ","  # whether decimal commas are allowed
        self._mark = ""  # decimal mark found so far
        self._strict = strict
        self._problems: list[str] = []
        self._events: list[Event] = []
        self._count = 0
        self._time_order = TimeOrder()
        self._words: dict[str, int] = {}  # lines without a number, by column outside the format
        self._nothing: dict[str, tuple[str, int]] = {}  # by column: first text for a blank, further lines
        self._out_of_range = OutOfRangeDuties()

    def recording(self) -> Recording:
        rows = iter(self._rows)
        names, self._problems = read_header(rows, self._rows, self._separator)
        columns = {name: array("d") for name in names if name not in ("", EVENT)}
        for cells in rows:
            row = self._row(names, cells, columns)
            if row is not None:
                self._keep(row, columns)
        if (back := self._time_order.backward_count) > self._count:
            first = next(each for each in self._problems if each.endswith(TIME_ALLOWED))
            raise TraceError(
                f"t goes back in {back} lines of {back + self._count}; {first}; "
                f"{self._time_order.first_reset_reason}"
            )
        self._out_of_range.check(self._count)
        found = {name: np.array(column, np.float64) for name, column in columns.items()}
        self._leave_out_words(found)
        self._problems += [
            f"{first}, and likewise in {more} more lines" if more else first
            for first, more in self._nothing.values()
        ]
        return Recording(found, self._events, problems=self._problems)

    def _leave_out_words(self, columns: dict[str, NDArray[np.float64]]) -> None:
        """Report each column outside the format that contains words, such as names of states, once."""
        for name, lines in self._words.items():
            if lines <= MAX_WORDS_LISTED:
                continue
            place = f", column {name}: "
            first = next(each for each in self._problems if place in each)
            self._problems = [each for each in self._problems if place not in each]
            self._problems.append(f"column {name} holds no numbers in {lines} lines, left out; {first}")
            if np.isnan(columns[name]).all():
                del columns[name]
            if columns.keys() == {"t"} and lines > MAX_PROBLEMS:
                raise TraceError(f"more than {MAX_PROBLEMS} bad values; the first: {first}")

    def _row(self, names: list[str], cells: list[str] | str, columns: Columns) -> dict[str, float] | None:
        if not cells:
            return None  # an empty line
        if isinstance(cells, str):
            self._report(cells)
            return None
        if self._rows.is_cut_off and not self._strict:
            self._report("the line has no line break: the file may be cut off there, so the line is left out")
            return None
        if len(cells) == len(names) + 1 and not cells[-1].strip():
            cells = cells[:-1]  # a separator after the last value
        if len(cells) != len(names):
            self._report(f"{len(cells)} values where the header names {len(names)} columns")
            return None
        text = ""
        time = cells[names.index("t")]
        row = {"t": self._value("t", time)}
        if math.isnan(row["t"]):  # such as a second line of units, or the header once more
            if not time.strip():
                self._report(f"column t: {time!r}: {TIME_ALLOWED}")
            return None
        for name, cell in zip(names, cells, strict=True):
            if name == EVENT:
                text = cell
            elif name not in ("", "t"):
                row[name] = self._value(name, cell)
        step = self._time_order.classify(row["t"])
        if step is TimeStep.BACKWARD:
            self._report(f"column t: {time!r}: {TIME_ALLOWED}")
            return None
        if step is TimeStep.PAST_OUTLIER:
            self._take_back(columns)
        if text:
            self._events.append(Event(self._count, text))
        return row

    def _value(self, name: str, cell: str) -> float:
        if not cell or cell.isspace():
            return math.nan
        text = self._with_point(cell) if self._commas and _must_be_number(name, cell) else cell
        value, allowed = _parse(name, text)
        if value is None and name != "t" and not self._strict and cell.strip().lower() in BLANK_WORDS:
            said = f"line {self._rows.line}, column {name}: {cell!r} means no value and is read as blank"
            first, more = self._nothing.get(name, (said, -1))
            self._nothing[name] = first, more + 1
            return math.nan
        if value is None:
            wrong = _number(text)
            if wrong is not None:
                self._out_of_range.add(name, wrong)
            blank = ("" if name == "t" else " and blank") + not_a_number_hint(name, cell)
            if not _must_be_number(name, cell):
                self._words[name] = self._words.get(name, 0) + 1
            if self._strict or self._words.get(name, 0) <= MAX_WORDS_LISTED:
                self._report(f"column {name}: {cell[:40]!r}: allowed are {allowed}{blank}")
            return math.nan
        return value

    def _with_point(self, cell: str) -> str:
        """A number with a decimal point instead of a comma. Raises TraceError if the file contains both
        marks, because one of them separates thousands and it is unknown which."""
        mark = "," if "," in cell else "." if "." in cell else ""
        if mark and self._mark not in ("", mark):
            raise TraceError(
                f"line {self._rows.line}: {cell[:40]!r} has another decimal mark than the numbers "
                "before: write all numbers with a decimal point and without a thousands separator"
            )
        self._mark = mark or self._mark
        return cell.replace(",", ".")

    def _keep(self, row: dict[str, float], columns: Columns) -> None:
        self._count += 1
        if self._count * len(columns) > MAX_CELLS:
            raise TraceError(f"more than {MAX_CELLS} values")
        for name, value in row.items():
            columns[name].append(value)

    def _take_back(self, columns: Columns) -> None:
        """Remove the row that was kept last."""
        self._count -= 1
        self._events = [each for each in self._events if each.tick != self._count]
        for column in columns.values():
            column.pop()
        self._report(
            f"column t: the time continues from before the outlier '{self._time_order.outlier_time:g}', "
            "so that line is left out"
        )

    def _report(self, problem: str) -> None:
        said = f"line {self._rows.line}, {problem}"
        if self._strict:
            raise TraceError(said)
        self._problems.append(said)
        if len(self._problems) > MAX_PROBLEMS:
            said = "; ".join(
                filter(
                    None,
                    (self._problems[0], self._time_order.first_reset_reason, self._out_of_range.unit_hint()),
                )
            )
            raise TraceError(f"more than {MAX_PROBLEMS} bad values; the first: {said}")


def _parse(name: str, cell: str) -> tuple[float | None, str]:
    """Value of a cell, None if it is not allowed, and the allowed values."""
    if SURFACE.fullmatch(name) and cell.strip() in _COLORS:
        return _COLORS[cell.strip()], ""
    value = _number(cell)
    allowed = allowed_values(name, math.nan if value is None else value)
    return (None, allowed) if allowed else (value, "finite numbers")


def _must_be_number(name: str, cell: str) -> bool:
    """Whether a cell must be a number, or is one: columns outside the format may contain words."""
    return _FORMAT_COLUMN.fullmatch(name) is not None or _number(cell.replace(",", ".", 1)) is not None


def _number(cell: str) -> float | None:
    """The number in a cell, None if it is none or not finite. Python reads 1_000 as a number, but a file that
    contains it means something else."""
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in cell else None


def write_csv(recording: Recording, path: str | Path) -> None:
    """Write a recording as CSV; the file appears completely or not at all. NaN is written as blank.

    Raises TraceError for an infinite value, which the format cannot represent.
    """
    recording.check_finite()
    names = sorted(recording.columns, key=_rank)
    events: dict[int, str] = {}
    for event in recording.events:
        events[event.tick] = f"{events[event.tick]}; {event.text}" if event.tick in events else event.text
    with replacing(Path(path)) as raw:
        # A remark may contain a file name that is no valid text.
        file = io.TextIOWrapper(raw, encoding="utf-8", errors="backslashreplace", newline="")
        try:
            writer = csv.writer(file, lineterminator="\n")
            # Python before 3.13 does not quote \r, which by itself ends a line when it is read.
            quoting = csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL)
            writer.writerow(names + [EVENT] * bool(events))
            for row, cells in enumerate(zip(*(_cells(recording, name) for name in names), strict=True)):
                text = events.get(row, "")
                (quoting if "\r" in text else writer).writerow([*cells, text] if events else cells)
        finally:
            file.detach()  # flushes; `replacing` closes the file


def _rank(name: str) -> tuple[int, list[tuple[int, str]]]:
    """Sort key of a column: t first, then the order of the format, port numbers by size."""
    parts = name.split(".")
    group = _ORDER.index(parts[0]) if parts[0] in _ORDER else len(_ORDER)
    return group, [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def _cells(recording: Recording, name: str) -> list[str]:
    column = recording[name]
    if SURFACE.fullmatch(name):
        return ["" if value != value else "black" if value else "white" for value in column.tolist()]
    return ["" if value != value else repr(value).removesuffix(".0") for value in column.tolist()]
