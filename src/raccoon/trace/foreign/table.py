"""Reading of plain tables of numbers with a bound on their size."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from raccoon.core.errors import TraceError
from raccoon.trace.recording import Column

MAX_BYTES = 64 << 20


def read_table(path: Path, names: tuple[str, ...], *, header: bool) -> dict[str, Column]:
    """The columns of a CSV of numbers. header: whether the first line contains the names.

    Raises TraceError naming file, line and value if a line has another number of values, a value is no finite
    number, the header differs or there is no data; FileNotFoundError if there is no file.
    """
    if path.stat().st_size > MAX_BYTES:
        raise TraceError(f"{path}: the file has more than {MAX_BYTES} bytes")
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        rows = csv.reader(file)
        try:
            if header:
                _check_header(next(rows, []), names)
            values = [_numbers(row, names, rows.line_num) for row in rows if row]
            if not values:
                raise TraceError("there is no row of numbers")
        except (TraceError, csv.Error) as error:
            raise TraceError(f"{path}: {error}") from None
    return dict(zip(names, np.array(values, np.float64).T.copy(), strict=True))


def _check_header(found: list[str], names: tuple[str, ...]) -> None:
    if tuple(name.strip() for name in found) != names:
        raise TraceError(f"line 1: the columns are {','.join(found)[:120]!r}: expected are {','.join(names)}")


def _numbers(row: list[str], names: tuple[str, ...], line: int) -> list[float]:
    if len(row) != len(names):
        raise TraceError(f"line {line}: {len(row)} values: expected are {','.join(names)}")
    values = []
    for name, cell in zip(names, row, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise TraceError(f"line {line}: {name} is {cell[:40]!r}: allowed are finite numbers")
        values.append(value)
    return values
