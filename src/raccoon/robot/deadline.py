"""The end of a match, whatever the program does then."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

AGAIN = 1.0
"""S until an alarm that was caught comes again."""


class MatchOver(BaseException):
    """The time is over. No Exception, so that a program that catches everything ends all the same."""


class Alarm:
    """rang: whether the time is over, also where the program has caught what told it so."""

    rang = False


@contextmanager
def real_deadline(seconds: float) -> Iterator[Alarm]:
    """MatchOver after so many real seconds, also in code that never comes back to the robot's loop.

    It comes again every second until the block is left. Only in the main thread, where signals arrive;
    elsewhere, and where there is no such timer, no limit.
    """
    alarm = Alarm()
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield alarm
        return

    def ring(_number: int, _frame: FrameType | None) -> None:
        alarm.rang = True
        raise MatchOver(f"the match of {seconds:g} s is over")

    previous = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        yield alarm
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
