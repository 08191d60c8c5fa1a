"""The results of a sweep on disk: one row a match, written as the matches end, and continued after any
interruption.

Rows are appended to a CSV file, so that a run that is killed loses at most the row it was writing. A small
JSON file beside it describes the sweep: a file is never continued by another sweep. When all matches are
there, the rows are sorted, so the finished file does not depend on interruptions. A `.parquet` is written
from the same rows, from time to time and at the end.
"""

from __future__ import annotations

import csv
import fcntl
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from raccoon.core.errors import ConfigError
from raccoon.core.files import write_atomically
from raccoon.core.schema import LONGEST, format_value
from raccoon.core.toml_text import BYTE_ORDER_MARK

Row = dict[str, Any]
"""One match: run, seed, status, reason, seconds, x, y, heading, position_error, heading_error, and the value
of every factor."""
TABLE_SUFFIXES = (".csv", ".parquet")
_WHOLE, _TEXT = ("run", "seed"), ("status", "reason")
REWRITE_GROWTH = 1.25
"""A .parquet is rewritten when the rows have grown by this factor, so that the total cost stays linear."""


def check_table(path: Path) -> None:
    """Raise ConfigError for a file to which no table can be written."""
    if path.suffix not in TABLE_SUFFIXES:
        raise ConfigError(f"{path}: allowed are the endings {' and '.join(TABLE_SUFFIXES)}")
    if path.suffix == ".parquet":
        _pyarrow(path)


class Results:
    """Rows by run. about: the sweep's description, as JSON; all of it but `end` must match to continue.
    Raises ConfigError if the file belongs to another sweep, or another process is writing it."""

    def __init__(self, path: str | Path, columns: tuple[str, ...], about: Mapping[str, Any]) -> None:
        self.path = Path(path)
        check_table(self.path)
        self._columns = columns
        self._about_path = self.path.with_name(self.path.name + ".sweep.json")
        self._rows_path = (
            self.path if self.path.suffix == ".csv" else self.path.with_name(self.path.name + ".rows.csv")
        )
        self.about = self._matching_description(about)
        self._parquet_rows = 0
        self.rows: dict[int, Row] = {}
        self._file = self._open_rows()

    def add(self, row: Row) -> None:
        """Append a row, which is then safe on disk. Raises ValueError for a run that is there already."""
        if row["run"] in self.rows:
            raise ValueError(f"run {row['run']} is in {self.path} already")
        self.rows[row["run"]] = row
        self._file.write(_line(row[name] for name in self._columns))
        self._file.flush()
        if self._rows_path != self.path and len(self.rows) >= REWRITE_GROWTH * self._parquet_rows:
            self._write_parquet()

    def finish(self) -> None:
        """Rewrite the file with the rows in the order of their runs instead of their completion."""
        if self.path == self._rows_path:
            write_atomically(self.path, self._all_lines())
        else:
            self._write_parquet()
            self._rows_path.unlink()

    def close(self) -> None:
        """Close the file; its rows stay. An empty table is removed, so that a corrected command can use its
        name. May be called twice."""
        try:
            if not self.rows and not self._file.closed:
                self._rows_path.unlink(missing_ok=True)
                self._about_path.unlink(missing_ok=True)
            if (
                self._rows_path.exists()
                and len(self.rows) > self._parquet_rows
                and self._rows_path != self.path
            ):
                self._write_parquet()
        finally:
            self._file.close()

    def _all_lines(self) -> bytes:
        lines = (_line(self.rows[run][name] for name in self._columns) for run in sorted(self.rows))
        return (_line(self._columns) + "".join(lines)).encode()

    def _matching_description(self, about: Mapping[str, Any]) -> dict[str, Any]:
        """The description beside the table, or `about` if there is none."""
        wanted: dict[str, Any] = json.loads(json.dumps(about))
        if not self._about_path.exists():
            for path in (self.path, self._rows_path):
                if path.exists():
                    raise ConfigError(f"{path} already exists and is not the result of a sweep")
            return wanted
        try:
            found = json.loads(self._about_path.read_text("utf-8"))
            end = found.get("end")
        except (ValueError, AttributeError) as error:
            raise ConfigError(
                f"{self._about_path}: not what a sweep writes: {error}; choose another file"
            ) from None
        if self._is_empty():
            return wanted
        for name in wanted:
            if name != "end" and found.get(name) != wanted[name]:
                known, own = format_value(found.get(name)), format_value(wanted[name])
                # Two that are both cut are digests, or look alike.
                what = f"{name}: {known}, and not {own}" if len(known + own) < 2 * LONGEST else name
                raise ConfigError(
                    f"{self.path} is the result of a sweep with another {what}; choose another file"
                )
        if (end is None) != (wanted["end"] is None):
            counts = "does not count" if end is None else "counts"
            raise ConfigError(
                f"{self.path} is the result of a sweep in which the end of a match {counts}; "
                "choose another file"
            )
        return {**wanted, "end": end}

    def _is_empty(self) -> bool:
        """Whether it contains no match: a sweep that was killed before its first one is not continued."""
        tables = [path for path in {self.path, self._rows_path} if path.exists()]
        return tables in ([], [self._rows_path]) and all(_has_no_row(each.read_bytes()) for each in tables)

    def _open_rows(self) -> IO[str]:
        """The file of rows, locked, with its rows read and an incomplete last line cut off."""
        if (
            self.path.exists() and not self._rows_path.exists()
        ):  # a finished .parquet that shall get more rows
            self.rows = {row["run"]: row for row in read_results(self.path)}
            write_atomically(self._rows_path, self._all_lines())
        file = self._rows_path.open("a+", encoding="utf-8", newline="")
        try:
            self._resume(file)
        except BaseException:
            file.close()
            raise
        return file

    def _resume(self, file: IO[str]) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ConfigError(f"{self.path}: another sweep is writing it") from None
        write_atomically(self._about_path, json.dumps(self.about, indent=1))
        data = self._rows_path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]  # of bytes: it may be torn in the midst of a letter
        if _has_no_row(whole):
            whole = b""  # the header may be that of another sweep
        if len(whole) != len(data):
            file.truncate(len(whole))
        if not whole:
            file.write(_line(self._columns))
            file.flush()
        self.rows = _read(_text_of(whole, self._rows_path), self._columns, self._rows_path)

    def _write_parquet(self) -> None:
        pyarrow = _pyarrow(self.path)
        parquet = pyarrow.parquet
        rows = [self.rows[run] for run in sorted(self.rows)]
        arrays = {
            name: pyarrow.array([row[name] for row in rows], _arrow_type(name)) for name in self._columns
        }
        table = pyarrow.table(arrays).replace_schema_metadata({"raccoon.sweep": json.dumps(self.about)})
        sink = io.BytesIO()
        parquet.write_table(table, sink)
        write_atomically(self.path, sink.getvalue())
        self._parquet_rows = len(rows)


def _has_no_row(data: bytes) -> bool:
    """Whether a file of rows has at most its header."""
    return not data or (data.startswith(b"run,") and data.find(b"\n") in (-1, len(data) - 1))


def read_results(path: str | Path) -> list[Row]:
    """The rows of a file, in the order of their runs. Raises ConfigError, FileNotFoundError."""
    path = Path(path)
    if path.suffix == ".parquet":
        rows: list[Row] = _pyarrow(path).parquet.read_table(path).to_pylist()
        return rows
    data = path.read_bytes()
    text = _text_of(data[: data.rfind(b"\n") + 1] or data, path)
    header = tuple(next(csv.reader(io.StringIO(text.removeprefix(BYTE_ORDER_MARK))), ()))
    found = _read(text, header, path)
    return [found[run] for run in sorted(found)]


def _text_of(data: bytes, path: Path) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not a table of a sweep: {error}") from None


def _read(text: str, columns: tuple[str, ...], path: Path) -> dict[int, Row]:
    """Rows by run. A spreadsheet may have put a byte order mark in front."""
    lines = csv.reader(io.StringIO(text.removeprefix(BYTE_ORDER_MARK), newline=""))
    header = tuple(next(lines, columns))
    if header != columns or "run" not in header:
        raise ConfigError(f"{path}: its columns are not those of this sweep: {', '.join(header[:12])}")
    rows: dict[int, Row] = {}
    for number, line in enumerate(lines, start=2):
        try:
            row = {name: _value(name, text) for name, text in zip(columns, line, strict=True)}
        except ValueError as error:
            raise ConfigError(f"{path}: row {number}: {error}") from None
        if row["run"] in rows:
            raise ConfigError(f"{path}: row {number}: run {row['run']} occurs twice")
        rows[row["run"]] = row
    return rows


def _value(name: str, text: str) -> Any:
    if name in _WHOLE:
        return int(text)
    return text if name in _TEXT else float(text or "nan")


def _line(values: Any) -> str:
    shown = io.StringIO()
    csv.writer(shown, lineterminator="\n").writerow([_text(each) for each in values])
    return shown.getvalue()


def _text(value: object) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(value)
    return " ".join(str(value).split())


def _arrow_type(name: str) -> Any:
    import pyarrow

    return pyarrow.int64() if name in _WHOLE else pyarrow.string() if name in _TEXT else pyarrow.float64()


def _pyarrow(path: Path) -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise ConfigError(f"{path}: Parquet needs pyarrow: pip install pyarrow, or choose .csv") from None
    return pyarrow
