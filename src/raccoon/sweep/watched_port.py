"""A port that ends a match: after its time, or when the program only computes."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from raccoon.core.port import Port, bystander_of
from raccoon.core.readings import Inputs, Outputs, Truth
from raccoon.robot.deadline import MAX_CAUGHT_READINGS, can_ring, end_process, raise_after


class MatchOver(BaseException):
    """The time is over. Not a subclass of Exception, so that a program that catches every Exception still
    ends."""


class WatchedPort:
    """Wraps a port; stores time and truth, and raises MatchOver after `seconds` of the port's time.

    If the program keeps catching it, its process is ended after a thousand times.
    """

    def __init__(self, port: Port, seconds: float) -> None:
        self._port = port
        self.bystander = bystander_of(port)
        self.limit = seconds
        self.time = 0.0
        self.truth: Truth | None = None
        self._ends = 0

    def read(self) -> Inputs:
        inputs = self._port.read()
        self.time, self.truth = inputs.time, inputs.truth
        if inputs.time > self.limit:
            self._ends += 1
            if self._ends > MAX_CAUGHT_READINGS:
                end_process(self.close)
            raise MatchOver(f"not done after {self.limit:g} s")
        return inputs

    def write(self, outputs: Outputs) -> None:
        self._port.write(outputs)

    def close(self) -> None:
        self._port.close()


@contextmanager
def wall_limit(seconds: float) -> Iterator[None]:
    """Raise MatchOver after so many real seconds.

    A signal brings it to the main thread, even out of a sleep; if the program has caught it ten times, a
    second apart, its process is ended. In other threads (of a Dask worker) it is raised between two lines of
    Python.
    """
    if can_ring():
        with raise_after(seconds, partial(_computes_too_long, seconds), lambda: None):
            yield
    else:
        with _thread_limit(seconds):
            yield


@contextmanager
def _thread_limit(seconds: float) -> Iterator[None]:
    lock, done, thread = threading.Lock(), threading.Event(), threading.get_ident()

    def ring() -> None:
        with lock:
            if not done.is_set():
                interrupt = ctypes.pythonapi.PyThreadState_SetAsyncExc
                interrupt(ctypes.c_ulong(thread), ctypes.py_object(MatchOver))

    timer = threading.Timer(seconds, ring)
    timer.daemon = True
    timer.start()
    try:
        yield
    except MatchOver as over:
        raise over if over.args else _computes_too_long(seconds) from None
    finally:
        with lock:
            done.set()
        timer.cancel()
        timer.join()


def _computes_too_long(seconds: float) -> MatchOver:
    return MatchOver(f"computes for more than {seconds:g} real seconds")
