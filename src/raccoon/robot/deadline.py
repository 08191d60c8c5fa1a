"""The end of a match, whatever the program does then."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class MatchOver(BaseException):
    """The time is over. No Exception, so that a program that catches everything ends all the same."""


@contextmanager
def real_deadline(seconds: float) -> Iterator[None]:
    """MatchOver after so many real seconds, also in code that never comes back to the robot's loop.

    Only in the main thread, where signals arrive; elsewhere, and where there is no such timer, no limit.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(_number: int, _frame: FrameType | None) -> None:
        raise MatchOver(f"the match of {seconds:g} s is over")

    previous = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
