"""Hints for messages about files and columns that cannot be read: what they probably are, and what is
accepted."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from raccoon.core.errors import TraceError
from raccoon.core.near_names import nearest_name
from raccoon.core.schema import format_value

ACCEPTED_TEXT = (
    "recordings are traces (.jsonl.gz), CSV with a column t (the time in s), MCAP (.mcap) and EMPS (.mat)"
)
OTHER_KINDS: Mapping[str, str] = {
    ".py": "a Python program",
    ".toml": "a robot.toml, a model or a table",
    ".md": "a text",
    ".html": "a report",
    ".json": "a result in JSON",
    **dict.fromkeys((".svg", ".png", ".gif", ".jpg", ".pdf"), "a picture"),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "a spreadsheet, which must be saved as CSV"),
    ".parquet": "a table of a sweep",
}
"""Descriptions of other files that lie beside recordings, by the endings of their names."""
PICTURE_SIGNATURES = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"%PDF")
"""First bytes of pictures, whatever their names."""
SWEEP_HEADER = "run,seed,status,"
SEPARATORS = (",", ";", "\t")
SNIFFED_BYTES = 4096
COUNTER_RANGES = (2.0**32, 2.0**31, 2.0**16)
"""Ranges after which the counters of small controllers' clocks wrap, in s, ms or us."""
WRAP_TOLERANCE = 0.02
"""Share of such a range within which a time is at its end, or at its beginning."""
MIN_OUT_OF_ORDER_SHARE = 0.9
"""Share of the previous time above which a time that goes back is out of order; below, a second recording has
started."""
MAX_INVALID_LETTERS = 4
"""Most invalid UTF-8 letters in a header: an old program may have written a few."""
MAX_MISNAMED_LISTED, OTHERS_SAID = 4, 6
SEPARATOR_PREFIX = "sep="
"""Start of the first line of some CSV files of Excel; the separator of the columns follows."""
COMMENT_MARKS = ("#", "%")
"""Start of the lines that MATLAB, NumPy and loggers write before the rows, the header among them."""
_TIME = re.compile(
    r"(.*[./_])?((time|zeit|timestamp|stamp|seconds?|secs?|millis|micros|ms|us)\b.*|t|t\W.*|time_.*)",
    re.IGNORECASE,
)
_DATE = re.compile(r"\d+[-/.:]\d+[-/.:]\d+.*")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")
_BETWEEN = r"[._/ \[\]-]*"
_KNOWN = re.compile(
    r"/*(motor.\d+.(duty|bemf|position|current|voltage|speed|force|torque|travel|angle|brake)"
    r"|servo.\d+.pulse.us|battery.voltage|imu.((gyro|accel).[xyz]|temperature)"
    r"|(analog|digital).\d+"
    r"|truth.(x|y|heading|surface.\d+))(\s*[(\[/].*)?".replace(".", _BETWEEN).replace(f"{_BETWEEN}*", ".*"),
    re.IGNORECASE,
)
"""The fixed names of the format, with anything that people and programs write between their parts and after
them."""
_ASKED = {
    "motor.N.duty": r"motor\.\d+\.(duty|voltage|force|torque)",
    "motor.N.bemf": r"motor\.\d+\.(bemf|position|speed|travel|angle)",
    "imu.gyro.z": r"imu\.gyro\.z",
    "battery.voltage": r"battery\.voltage",
}
"""Columns that the diagnosis of a drive needs, each with the pattern of the names under which it may
exist."""
_NAMES = (
    *(f"motor.N.{each}" for each in ("duty", "bemf", "position", "current", "voltage", "speed")),
    *(f"motor.N.{each}" for each in ("force", "torque", "travel", "angle", "brake")),
    *(f"imu.{sensor}.{axis}" for sensor in ("gyro", "accel") for axis in "xyz"),
    *("battery.voltage", "imu.temperature", "analog.N", "digital.N", "servo.N.pulse_us"),
    *("truth.x", "truth.y", "truth.heading", "truth.surface.N"),
)
"""The names of the format, with N for the number of a port."""
_MADE_UP = re.compile(r"t|event|fault\..*|estimate\..*")
"""The other names of the format, parts of which are free."""
_PARTS = re.compile(r"(motor|servo|battery|imu|analog|digital|truth)(gyro|accel|surface)?(\d+)?(.*)")


def missing_time_reason(names: Iterable[str]) -> str:
    """Why a header without t is invalid, with the column that is probably the time."""
    header = ",".join(names)
    cells = _cells(header)
    said = f"there is no column t in the header {header[:80]!r}; t is the time in s"
    if all(re.fullmatch(r"[-+]?[\d.]+(e[-+]?\d+)?", each, re.IGNORECASE) for each in cells):
        return f"{said}, and the first line must hold the names of the columns"
    if len(cells) == 1 and "t" in header.split():
        return f"{said}: columns are separated by commas, semicolons or tabs, not by spaces"
    alike = next((each for each in cells if _TIME.fullmatch(without_comment_mark(each))), None)
    return said if alike is None else f"{said}: if {format_value(alike)} is the time, rename it t"


def _cells(header: str) -> list[str]:
    return [each.strip().strip('"') for each in re.split("[,;\t]", header)]


def without_comment_mark(text: str) -> str:
    """The text without a leading comment mark."""
    return text.lstrip("".join(COMMENT_MARKS) + " ")


def is_comment(line: str) -> bool:
    """Whether a line before the rows is a comment, and not the header after a comment mark."""
    if not line.startswith(COMMENT_MARKS):
        return False
    cells = [each.strip() for each in _cells(without_comment_mark(line))]
    return len(cells) == 1 or not any(_TIME.fullmatch(each) for each in cells)


def clock_reset_reason(before: float, now: float) -> str:
    """The probable reason why the time goes back from `before` to `now` and continues from there, as a
    message."""
    said = f"it goes back from {before:.9g} to {now:.9g} there"
    for size in COUNTER_RANGES:
        for unit in (1.0, 1e-3, 1e-6):
            most = size * unit
            if abs(before - most) < WRAP_TOLERANCE * most and 0.0 <= now < WRAP_TOLERANCE * most:
                return f"{said}: does a counter wrap around at {most:.10g}? Add that to all later times"
    if now > MIN_OUT_OF_ORDER_SHARE * before:
        return (
            f"{said}: are the rows in order, and does t come from a clock that is never set (time.monotonic)?"
        )
    return f"{said}: is it a second recording? Then put each into its own file"


def not_a_number_hint(name: str, cell: str) -> str:
    """The probable content of a cell that is no number, as a message; "" if unknown."""
    if name == "t" and _DATE.fullmatch(cell.strip()):
        return "; it looks like a date or a time of day"
    halves = _DECIMAL_COMMA.fullmatch(cell.strip())
    return "; where commas separate the columns, write a half as 0.5" if halves else ""


def misnamed_columns_note(names: Collection[str]) -> str:
    """A message about the columns that are probably those of the format except for a unit, capital letters,
    other separators between their parts or a mistyped letter; "" if there are none."""
    matches = {name: _KNOWN.fullmatch(name) for name in names}
    meant = {name: _format_name(match[1]) if match else _mistyped(name) for name, match in matches.items()}
    found = [f"{name!r} should be {known}" for name, known in meant.items() if known and known not in names]
    more = f" and {len(found) - MAX_MISNAMED_LISTED} more" if len(found) > MAX_MISNAMED_LISTED else ""
    return (
        f"columns with other names are not used: {', '.join(found[:MAX_MISNAMED_LISTED])}{more}"
        if found
        else ""
    )


def _mistyped(name: str) -> str:
    """The name of the format whose parts each differ from those of `name` by at most one letter (missing,
    additional or wrong); "" if there is none. Names of different sensors differ by a whole part."""
    port = re.search(r"\d+", name)
    parts = re.sub(r"\d+", "N", name).split(".")
    for known in _NAMES:
        own = known.split(".")
        if len(parts) == len(own) and all(map(_is_mistyped, parts, own)):
            return known if port is None else known.replace("N", port[0])
    return ""


def _is_mistyped(part: str, own: str) -> bool:
    return part == own or (abs(len(part) - len(own)) <= 1 and nearest_name(part, [own]) == own)


def unnamed(names: Collection[str]) -> str:
    """A message about the columns that are not in the format, if the recording lacks a kind of column that
    the diagnosis of a drive needs; "" if nothing is missing or there are no other columns."""
    missing = [name for name, kind in _ASKED.items() if not any(re.fullmatch(kind, each) for each in names)]
    others = [name for name in names if not _KNOWN.fullmatch(name) and not _MADE_UP.fullmatch(name)]
    more = f" and {len(others) - OTHERS_SAID} more" if len(others) > OTHERS_SAID else ""
    if not (missing and others):
        return ""
    return (
        f"no column is named {', '.join(missing)} (N is the motor port): rename the column that holds it, if "
        f"it is among {', '.join(map(repr, others[:OTHERS_SAID]))}{more}; see docs/trace-format.md"
    )


def _format_name(name: str) -> str:
    parts = _PARTS.fullmatch(re.sub(_BETWEEN, "", name.lower()))
    assert parts is not None  # every name of _KNOWN begins so
    return ".".join(filter(None, parts.groups())).replace("pulseus", "pulse_us")


def find_csv_separator(path: Path) -> str:
    """The separator of the columns of a CSV: a comma, or the one that spreadsheets write with decimal commas.

    Raises TraceError for a file that is no CSV, by its name and its beginning, because its first line would
    otherwise be shown as a header.
    """
    with path.open("rb") as file:
        start = file.read(SNIFFED_BYTES)
    lines = iter(start.split(b"\n"))
    line = next(lines)
    text = line.decode("utf-8-sig", "replace")
    while is_comment(text) and (line := next(lines, b"")):
        text = line.decode("utf-8", "replace")
    text = without_comment_mark(text)
    if text.startswith(SEPARATOR_PREFIX) and text[4:5] in SEPARATORS:
        return text[4:5]
    for separator in SEPARATORS:
        if "t" in [name.strip().strip('"') for name in text.split(separator)]:
            return separator
    if path.suffix in OTHER_KINDS and b"raccoon trace" not in line:
        raise TraceError(f"it seems to be {OTHER_KINDS[path.suffix]}; {ACCEPTED_TEXT}")
    _check_form(start, text)
    if text.startswith(SWEEP_HEADER):
        raise TraceError(f"it seems to be the table of a sweep; {ACCEPTED_TEXT}")
    if path.suffix != ".csv" and "," not in text:
        raise TraceError(
            f"it seems to be a text that begins with {format_value(text.strip())}; {ACCEPTED_TEXT}"
        )
    return SEPARATORS[0]


def _check_form(start: bytes, line: str) -> None:
    """Raise TraceError for a file that must be converted or renamed to be a CSV or a trace."""
    check_not_picture(start)
    if start.startswith((b"\x1f\x8b", b"PK\x03\x04")):
        raise TraceError("the file is compressed: unpack it first, or name it .jsonl.gz if it is a trace")
    halves = (
        start[:40:2].count(0),
        start[1:40:2].count(0),
    )  # in UTF-16 every second byte is 0, in a program any byte
    if start.startswith((b"\xff\xfe", b"\xfe\xff")) or (max(halves) > 8 and min(halves) == 0):
        raise TraceError("the text is UTF-16: save it as UTF-8")
    if start.lstrip().startswith(b"{"):
        raise TraceError("it looks like JSON Lines, not CSV: name it .jsonl")
    if "\0" in line or line.count("\ufffd") > MAX_INVALID_LETTERS:
        raise TraceError("it is not text: a CSV file begins with the names of its columns")


def check_not_picture(start: bytes) -> None:
    """Raise TraceError for a file that begins like a picture, whatever its name."""
    if start.startswith(PICTURE_SIGNATURES):
        raise TraceError(f"it seems to be {OTHER_KINDS['.png']}; {ACCEPTED_TEXT}")
