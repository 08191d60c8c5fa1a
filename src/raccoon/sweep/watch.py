"""A port that ends a match: after its time, or when the program only computes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from raccoon.core.port import Port
from raccoon.core.readings import Inputs, Outputs, Truth


class MatchOver(BaseException):
    """The time is over. No Exception, so that a program that catches everything ends all the same."""


class WatchedPort:
    """Wraps a port; remembers time and truth, and raises MatchOver after `seconds` of the port's time."""

    def __init__(self, port: Port, seconds: float) -> None:
        self._port = port
        self.limit = seconds
        self.time = 0.0
        self.truth: Truth | None = None

    def read(self) -> Inputs:
        inputs = self._port.read()
        self.time, self.truth = inputs.time, inputs.truth
        if inputs.time > self.limit:
            raise MatchOver(f"not done after {self.limit:g} s")
        return inputs

    def write(self, outputs: Outputs) -> None:
        self._port.write(outputs)

    def close(self) -> None:
        self._port.close()


@contextmanager
def wall_limit(seconds: float) -> Iterator[None]:
    """MatchOver after so many real seconds. Only in the main thread, where signals arrive, else no limit."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def ring(_number: int, _frame: FrameType | None) -> None:
        raise MatchOver(f"computes for more than {seconds:g} real seconds")

    previous = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
