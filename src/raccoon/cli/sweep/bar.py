"""A progress bar on the standard error output; a line every tenth where that is no terminal."""

from __future__ import annotations

import sys
import time
from types import TracebackType

WIDTH = 30


class Bar:
    """Shows matches played, failures and the time that is left."""

    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._first: int | None = None
        self._tenths = -1
        self._live = sys.stderr.isatty()
        self._shown = False

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live and self._shown:
            print(file=sys.stderr)

    def begin(self) -> None:
        """Called before the match on the robot of robot.toml, which comes first and may take a while."""
        if self._live:
            self._shown = True
            print("the match of robot.toml's own robot comes first ...", file=sys.stderr, end="", flush=True)

    def show(self, played: int, total: int, failed: int) -> None:
        """Called after each match."""
        if self._first is None:
            self._first = played - 1
        tenths = 10 * played // total
        if not self._live and tenths == self._tenths:
            return
        self._tenths, self._shown = tenths, True
        text = self._text(played, total, failed)
        print(text, file=sys.stderr, end="" if self._live else "\n", flush=True)

    def _text(self, played: int, total: int, failed: int) -> str:
        full = WIDTH * played // total
        spent = time.monotonic() - self._begun
        left = spent / (played - (self._first or 0)) * (total - played)
        bar = f"[{'#' * full}{'.' * (WIDTH - full)}] " if self._live else ""
        start = "\r" if self._live else ""
        return f"{start}{bar}{played}/{total} matches, {failed} failed, {_clock(left)} left "


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"
