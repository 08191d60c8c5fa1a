"""Ends a match on time, whatever the program does."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

RING_AGAIN_S = 1.0
"""s until an alarm that the program caught is raised again."""
MAX_CAUGHT_READINGS, MAX_CAUGHT_ALARMS = 1000, 10
"""How many times a program may catch MatchOver, raised by readings and by alarms, before its process is
ended."""
NEVER_ENDS_MESSAGE = (
    "raccoon: the program did not stop when the time was over: its except BaseException (or bare except) "
    "also catches the end of the match; its process is ended. Write except Exception\n"
)


class MatchOver(BaseException):
    """The time is over. Not a subclass of Exception, so that a program that catches every Exception still
    ends."""


class Alarm:
    """rings: how often MatchOver was raised in the program, including the times it was caught."""

    rings = 0


def end_match(robot: Robot) -> NoReturn:
    """Raise MatchOver; the next command switches everything off. Ends the process of a program that keeps
    catching it."""
    robot.ends += 1
    if robot.ends > MAX_CAUGHT_READINGS:
        end_process(robot.port.close)
    robot.attachments.switch_off()
    raise MatchOver(f"the match ended at {robot.deadline:.2f} s")


def can_ring() -> bool:
    """Whether an alarm works in this thread: only in the main one, and if the system has such a timer."""
    return threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")


def end_process(close: Callable[[], None]) -> None:
    """End the process of a program that nothing else ends, with status 1. close: the port, so that nothing
    keeps moving."""
    with suppress(Exception):
        sys.stdout.flush()
        os.write(2, NEVER_ENDS_MESSAGE.encode())
    try:
        close()
    finally:
        os._exit(1)


@contextmanager
def real_deadline(seconds: float, close: Callable[[], None]) -> Iterator[Alarm]:
    """Raise MatchOver after so many real seconds, even in code that never returns to the robot's loop.

    It is raised again every second until the block is left; after ten times the process is ended
    (`end_process`). This works only in the main thread, where signals arrive, and if the system has such a
    timer; otherwise there is no limit.
    """
    if not can_ring():
        yield Alarm()
        return
    with raise_after(seconds, lambda: MatchOver(f"the match of {seconds:g} s is over"), close) as alarm:
        yield alarm


@contextmanager
def raise_after(
    seconds: float, over: Callable[[], BaseException], close: Callable[[], None]
) -> Iterator[Alarm]:
    """Raise what `over` returns after so many real seconds and every second from then on, in the main thread;
    end the process of a program that has caught it ten times. close: see `end_process`."""
    alarm = Alarm()

    def ring(_number: int, _frame: FrameType | None) -> None:
        alarm.rings += 1
        if alarm.rings > MAX_CAUGHT_ALARMS:
            end_process(close)
        raise over()

    previous = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds, RING_AGAIN_S)
    try:
        yield alarm
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
