"""A progress bar on standard error, or one line per tenth of the matches if that is no terminal."""

from __future__ import annotations

import sys
import time
from types import TracebackType

WIDTH = 30


class Bar:
    """Progress bar with the number of matches played and failed and the remaining time. A context manager."""

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
        """Announce the match on the robot of robot.toml, which is played first and may take a while."""
        if self._live:
            self._shown = True
            print("the match of robot.toml's own robot comes first ...", file=sys.stderr, end="", flush=True)

    def show(self, played: int, total: int, failed: int) -> None:
        """Show the progress; call it after each match. played, total, failed: numbers of matches."""
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
