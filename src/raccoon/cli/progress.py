"""A line that shows the progress of a long command."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from raccoon.core.progress import report_to

WIDTH = 100


@contextmanager
def show_progress() -> Iterator[None]:
    """Context in which a line on standard error shows the current step and the elapsed time, s, if that is a
    terminal; the line is erased at the end."""
    if not sys.stderr.isatty():
        yield
        return
    begun, width = time.monotonic(), min(shutil.get_terminal_size().columns - 1, WIDTH)

    shown = False

    def show(doing: str) -> None:
        nonlocal shown
        shown, text = True, f"{time.monotonic() - begun:3.0f} s: {doing}"
        print(f"\r{text[:width]:{width}}", file=sys.stderr, end="", flush=True)

    try:
        with report_to(show):
            yield
    finally:
        if shown:
            print(f"\r{'':{width}}\r", file=sys.stderr, end="", flush=True)
