"""Long sentences on a terminal."""

from __future__ import annotations

import shutil
import sys
import textwrap

MIN_WIDTH = 40
"""Letters of a line below which a sentence is no easier to read in parts."""
HANGING_INDENT = 4


def print_wrapped(text: str) -> None:
    """Print. On a terminal a line that is too long breaks between words, and goes on further in; in a file
    it stays one, for what looks for a sentence there."""
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
