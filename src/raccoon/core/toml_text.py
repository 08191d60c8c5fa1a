"""The text of a TOML file, robot.toml or another, and what is wrong with one that is not TOML."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.core.schema import format_value

BYTE_ORDER_MARK = "\ufeff"
_OUTSIDE_QUOTES = r"(?:[^\"'#]|\"[^\"]*\"|'[^']*')*"
_TOML_SLIPS = (
    (r"=\s*(True|False)\b", "; write true and false in small letters"),
    (r"=\s*-?\d+,\d", "; write a number with a decimal point"),
    (r"=\s*[^\W\d][\w-]*\s*(#|$)", "; put a text in quotes"),
    (r"=\s*(#|$)", "; write a value, or leave the line out"),
    (r"[“”„‟‘’]", "; write straight quotes, as on the keyboard"),
    (
        rf"^{_OUTSIDE_QUOTES}[^\x00-\x7F]|^\[{_OUTSIDE_QUOTES}\w +\w",
        '; put a name with spaces or letters beyond a to z in quotes, as in [servo."the claw"]',
    ),
)
"""Common mistakes that are not TOML, as patterns, with hints."""


def parse_toml(content: str | bytes) -> dict[str, Any]:
    """The tables of a TOML file, with or without the byte order mark that Windows editors write.

    Raises ConfigError if it is not TOML.
    """
    try:
        text = content if isinstance(content, str) else content.decode("utf-8")
    except UnicodeDecodeError as error:
        packed = isinstance(content, bytes) and content.startswith(b"\x1f\x8b")
        hint = "it is compressed, like a recording" if packed else f"{error}; save it as UTF-8"
        raise ConfigError(f"not a TOML file: {hint}") from None
    text = text.removeprefix(BYTE_ORDER_MARK)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # e.g. a number of thousands of digits, a thousand brackets
        raise ConfigError(f"not a TOML file: {error}{_quoted_line(text, str(error))}") from None


def _quoted_line(text: str, error: str) -> str:
    """The line named in an error of the TOML reader, quoted with a hint."""
    found = re.search(r"\(at line (\d+), ", error)
    if found is None:
        return ""
    line = text.split(chr(10))[int(found[1]) - 1].strip()
    hint = next((hint for pattern, hint in _TOML_SLIPS if re.search(pattern, line)), "")
    return f": {format_value(line)}{hint}"
