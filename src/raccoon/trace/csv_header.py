"""The header of a CSV file: its column names, after whatever other programs write before it."""

from __future__ import annotations

from collections.abc import Iterator

from raccoon.core.errors import TraceError
from raccoon.trace.csv_rows import CsvRows
from raccoon.trace.file_hints import (
    COMMENT_MARKS,
    SEPARATOR_PREFIX,
    is_comment,
    misnamed_columns_note,
    missing_time_reason,
    without_comment_mark,
)


def read_header(
    rows: Iterator[list[str] | str], file: CsvRows, separator: str
) -> tuple[list[str], list[str]]:
    """The names of the columns ("" for those without one) and the problems of the header.

    Comments before the header are skipped, and a comment mark before the header itself (`# t,...`) is
    removed. Raises TraceError if there is no header with t or a name occurs twice.
    """
    names = next(rows, [])
    if names == [SEPARATOR_PREFIX, ""]:
        names = next(rows, [])
    while not isinstance(names, str) and is_comment(separator.join(names)):
        names = next(rows, [])
    if isinstance(names, str):
        raise TraceError(f"line {file.line}, {names}")
    names = [name.strip() for name in names]
    if (
        names
        and names[0].startswith(COMMENT_MARKS)
        and "t" in [without_comment_mark(each) for each in names[:1]] + names[1:]
    ):
        names[0] = without_comment_mark(names[0])
    if "t" not in names:
        raise TraceError(f"line {file.line}: {missing_time_reason(names)}")
    while not names[-1]:
        names.pop()
    for name in filter(None, names):
        if names.count(name) > 1:
            raise TraceError(f"line {file.line}: column name {name!r} occurs twice")
    nameless = names.count("")
    problems = [f"columns without a name are left out: {nameless} of {len(names)}"] if nameless else []
    return names, problems + list(filter(None, [misnamed_columns_note([name for name in names if name])]))
