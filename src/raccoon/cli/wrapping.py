"""Wrapping of long lines on a terminal."""

from __future__ import annotations

import shutil
import sys
import textwrap

MIN_WIDTH = 40
"""Smallest width to which lines are wrapped, characters: on a narrower terminal wrapping does not help."""
HANGING_INDENT = 4


def print_wrapped(text: str) -> None:
    """Print a text. On a terminal, lines that are too long are wrapped between words with a hanging indent;
    elsewhere they stay whole, so that programs find sentences in the output."""
    if sys.stdout.isatty():
        width = max(MIN_WIDTH, shutil.get_terminal_size().columns)
        text = "\n".join(_wrapped(line, width) for line in text.split("\n"))
    print(text)


def _wrapped(line: str, width: int) -> str:
    if len(line) <= width:
        return line
    inside = " " * (len(line) - len(line.lstrip()) + HANGING_INDENT)
    return textwrap.fill(
        line, width, subsequent_indent=inside, break_long_words=False, break_on_hyphens=False
    )
