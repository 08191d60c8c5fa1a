"""A background thread that reads a slow sensor and provides its newest sample.

A bus transfer takes a millisecond and a stuck bus a second; a cycle of 5 ms can wait for neither. So the
thread waits and the cycle takes the newest sample. Replay is exact nevertheless: the cycle takes its sample
before its Inputs exist, these Inputs are recorded, and nothing above them uses the thread.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from raccoon.core.clock import Clock, RealClock, Ticker

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)

FAILURES_UNTIL_SETUP = 3
"""Failed readings in a row after which the sensor is set up again; a single failed transfer is nothing
unusual."""
REST_AFTER_FAILURE_S = 0.1
"""Pause after a failure, s: a dead sensor is read less often, to keep the bus free for other devices."""


class Sensor(Protocol[T_co]):
    """A sensor that is set up and then read repeatedly; both may raise OSError."""

    def set_up(self) -> None: ...

    def read(self) -> T_co: ...


@dataclass(frozen=True, slots=True)
class Numbered(Generic[T]):
    """A sample and its number, which distinguishes a new sample from the last."""

    number: int
    value: T


class Source(Protocol[T]):
    """The source of a port's samples."""

    @property
    def newest(self) -> Numbered[T] | None:
        """The newest sample, None before the first; returns at once."""
        ...

    def close(self) -> None: ...


class Sampler(Generic[T]):
    """Reads `sensor` every `period` s once started; `step` reads once without a thread.

    error: why the last reading failed, empty if it did not. on_close: called by `close`.
    """

    def __init__(
        self,
        sensor: Sensor[T],
        period: float,
        clock: Clock | None = None,
        *,
        on_close: Callable[[], None] | None = None,
    ) -> None:
        self.error = ""
        self._sensor = sensor
        self._period = period
        self._clock = clock or RealClock()
        self._on_close = on_close
        self._newest: Numbered[T] | None = None
        self._failures = FAILURES_UNTIL_SETUP
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def newest(self) -> Numbered[T] | None:
        # One reference, replaced atomically: a reader sees the old sample or the new one, never a mixture.
        return self._newest

    def start(self) -> None:
        """Start to read in the background."""
        self._thread = threading.Thread(target=self._run, name="raccoon-i2c", daemon=True)
        self._thread.start()

    def step(self) -> bool:
        """Read once; False if that failed."""
        try:
            if self._failures >= FAILURES_UNTIL_SETUP:
                self._sensor.set_up()
                self._failures = 0
            value = self._sensor.read()
        except OSError as error:
            self._failures += 1
            self.error = str(error)
            return False
        self._failures = 0
        self.error = ""
        number = 0 if self._newest is None else self._newest.number + 1
        self._newest = Numbered(number, value)
        return True

    def close(self) -> None:
        """Stop reading. Returns within half a second even while the bus is stuck. May be called twice."""
        self._stop.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join(0.5)
        closer, self._on_close = self._on_close, None
        if closer is not None:
            closer()

    def _run(self) -> None:
        ticker = Ticker(self._period, self._clock)
        while not self._stop.is_set():
            if not self.step():
                self._stop.wait(REST_AFTER_FAILURE_S)
            ticker.wait()
