"""A line that says what a long command is doing."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from raccoon.diagnose.watch import watched

WIDTH = 100


@contextmanager
def diagnosis_shown() -> Iterator[None]:
    """Inside, a line on the standard error output follows a diagnosis where that is a terminal; it is gone
    afterwards."""
    if not sys.stderr.isatty():
        yield
        return
    begun, width = time.monotonic(), min(shutil.get_terminal_size().columns - 1, WIDTH)

    def show(text: str) -> None:
        print(f"\r{text[:width]:{width}}", file=sys.stderr, end="", flush=True)

    try:
        with watched(lambda doing: show(f"{time.monotonic() - begun:3.0f} s: {doing}")):
            yield
    finally:
        show("")
        print("\r", file=sys.stderr, end="", flush=True)
