"""A line that says what a long command is doing."""

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
    """Inside, a line on the standard error output says what takes long, where that is a terminal; it is gone
    afterwards."""
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
