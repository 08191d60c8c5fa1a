"""Motors stop on every way out, also on the ways that Python does not unwind by itself."""

from __future__ import annotations

import atexit
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

# SIGINT already raises KeyboardInterrupt; these would end the process without unwinding it.
_ENDING_SIGNALS = (signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stopped_on_exit(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` when the block is left: by return, by an error, by Ctrl-C, SIGTERM, SIGHUP or sys.exit.

    SIGTERM and SIGHUP raise SystemExit (status 128 + number) where the program stands, so every `finally` on
    the way runs. `stop` may be called more than once. Outside the main thread signals stay as they are.
    """
    atexit.register(stop)
    previous = {}
    if threading.current_thread() is threading.main_thread():
        for number in _ENDING_SIGNALS:
            previous[number] = signal.signal(number, _leave)
    try:
        yield
    finally:
        try:
            stop()
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)
            atexit.unregister(stop)


def _leave(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
