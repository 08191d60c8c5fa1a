"""A helper thread that reads a slow sensor and hands over its newest sample.

A bus transfer takes a millisecond and a stuck bus a second; a cycle of 5 ms can wait for neither. So the
thread waits and the cycle takes what is there. Replay stays exact all the same: which sample a cycle found
is decided before the cycle's Inputs exist, those Inputs are what is recorded, and nothing above them asks
the thread.
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
"""Readings in a row that must fail before the sensor is set up again; one bad transfer is nothing unusual."""
REST_AFTER_FAILURE_S = 0.1
"""s; a dead sensor is not asked as often as a living one, for the sake of its neighbours on the bus."""


class Sensor(Protocol[T_co]):
    """Something to set up and then read again and again; both may raise OSError."""

    def set_up(self) -> None: ...

    def read(self) -> T_co: ...


@dataclass(frozen=True, slots=True)
class Numbered(Generic[T]):
    """A sample and its number, by which a new one is told from the last."""

    number: int
    value: T


class Source(Protocol[T]):
    """Where a port takes samples from."""

    @property
    def newest(self) -> Numbered[T] | None:
        """The newest sample, None before the first; returns at once."""
        ...

    def close(self) -> None: ...


class Sampler(Generic[T]):
    """Reads `sensor` every `period` s once started; `step` does one round for those who want no thread.

    error: why the last reading failed, empty where it did not.
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
        # One reference, replaced whole: a reader sees the old sample or the new one, never a mixture.
        return self._newest

    def start(self) -> None:
        """Begin to read in the background."""
        self._thread = threading.Thread(target=self._run, name="raccoon-i2c", daemon=True)
        self._thread.start()

    def step(self) -> bool:
        """Read once; False where that failed."""
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
