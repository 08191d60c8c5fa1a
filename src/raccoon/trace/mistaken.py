"""A file that is no recording: what it seems to be, and what is taken."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from raccoon.core.errors import TraceError
from raccoon.core.schema import shown

TAKEN = "recordings are traces (.jsonl.gz), CSV with a column t (the time in s), MCAP (.mcap) and EMPS (.mat)"
OTHERS: Mapping[str, str] = {
    ".py": "a Python program",
    ".toml": "a robot.toml, a model or a table",
    ".md": "a text",
    ".html": "a report",
    ".json": "a result in JSON",
    **dict.fromkeys((".svg", ".png", ".gif", ".jpg", ".pdf"), "a picture"),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "a spreadsheet, which has to be saved as CSV"),
    ".parquet": "a table of a sweep",
}
"""What files are that people have beside their recordings, by the endings of their names."""
SWEEP_HEADER = "run,seed,status,"
SEPARATORS = (",", ";", "\t")
KIND_BYTES = 4096
MOST_ODD = 4
"""Letters of a header that are no UTF-8: an old program may have written a few."""


def csv_separator(path: Path) -> str:
    """What stands between the columns of a CSV: a comma, or what a spreadsheet writes where halves are 0,5.

    Raises TraceError for what is no CSV, by its name and by how it begins: its first line would be shown as a
    header.
    """
    with path.open("rb") as file:
        start = file.read(KIND_BYTES)
    line = start.partition(b"\n")[0]
    text = line.decode("utf-8-sig", "replace")
    for separator in SEPARATORS:
        if "t" in [name.strip().strip('"') for name in text.split(separator)]:
            return separator
    if path.suffix in OTHERS and b"raccoon trace" not in line:
        raise TraceError(f"it seems to be {OTHERS[path.suffix]}; {TAKEN}")
    _check_form(start, text)
    if text.startswith(SWEEP_HEADER):
        raise TraceError(f"it seems to be the table of a sweep; {TAKEN}")
    if path.suffix != ".csv" and "," not in text:
        raise TraceError(f"it seems to be a text that begins with {shown(text.strip())}; {TAKEN}")
    return SEPARATORS[0]


def _check_form(start: bytes, line: str) -> None:
    """Raise TraceError for what would be a CSV or a trace in another form or by another name."""
    if start.startswith((b"\x1f\x8b", b"PK\x03\x04")):
        raise TraceError("the file is packed: unpack it first, or name it .jsonl.gz where it is a trace")
    halves = (
        start[:40:2].count(0),
        start[1:40:2].count(0),
    )  # of UTF-16 every second byte is 0, of a program any
    if start.startswith((b"\xff\xfe", b"\xfe\xff")) or (max(halves) > 8 and min(halves) == 0):
        raise TraceError("the text is UTF-16: save it as UTF-8")
    if start.lstrip().startswith(b"{"):
        raise TraceError("it looks like JSON Lines, not CSV: name it .jsonl")
    if "\0" in line or line.count("\ufffd") > MOST_ODD:
        raise TraceError("it is no text: a CSV file begins with the names of its columns")
