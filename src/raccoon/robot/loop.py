"""Around the loop: motors stop on every way out, even where Python does not unwind the stack, and ticks are
on time."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

# These would end the process without unwinding it; SIGINT see `_defers_interrupt`.
_ENDING_SIGNALS = (signal.SIGTERM, signal.SIGHUP)

# Above ordinary programs, below the kernel's own threads.
PRIORITY = 40


@contextmanager
def punctual() -> Iterator[None]:
    """Avoid delays of ticks inside the block.

    A full garbage collection walks through every object of every loaded library (80 ms on a desktop core,
    most of a second on a Raspberry Pi 3, in which time the supervisor would stop the motors). So it is done
    now, and existing objects are left out of later ones. If the system permits it, the thread that drives
    gets real-time priority. Threads that it starts do not inherit that: four that process pictures would keep
    it from every core.
    """
    gc.collect()
    gc.freeze()
    policy, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    try:
        yield
    finally:
        try:
            os.sched_setscheduler(0, policy, parameter)
        except PermissionError:  # only root may let what it starts inherit again
            with suppress(PermissionError):
                os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, parameter)
        gc.unfreeze()


@contextmanager
def stopped_on_exit(stop: Callable[[], None]) -> Iterator[None]:
    """Call `stop` when the block is left: by return, by an error, by Ctrl-C, SIGTERM, SIGHUP or sys.exit.

    SIGTERM and SIGHUP raise SystemExit (status 128 + number) where the program stands, so every `finally` on
    the way runs. A signal that is ignored stays ignored (nohup does that: the program is to outlive its
    terminal). `stop` may be called more than once. Outside the main thread signals stay as they are.
    """
    atexit.register(stop)
    previous = {}
    if threading.current_thread() is threading.main_thread():
        for number in _ENDING_SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                previous[number] = signal.signal(number, _exit_on_signal)
        if _defers_interrupt(signal.getsignal(signal.SIGINT)):
            previous[signal.SIGINT] = signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        try:
            stop()
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)
            atexit.unregister(stop)


def _defers_interrupt(handler: object) -> bool:
    """Whether a handler of SIGINT defers Ctrl-C. asyncio's does until the coroutine awaits something, while a
    robot that drives in it would drive on. `asyncio.run` replaces Python's own handler by it."""
    asyncios = getattr(getattr(handler, "func", None), "__qualname__", "") == "Runner._on_sigint"
    return asyncios or handler is signal.default_int_handler


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _exit_on_signal(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
