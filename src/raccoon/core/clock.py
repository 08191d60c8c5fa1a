"""Clocks as arguments: nothing above a port reads the machine's clock, and no test sleeps."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Monotonic seconds, and waiting until a given time."""

    def now(self) -> float:
        """Seconds since some fixed moment; never decreases."""
        ...

    def sleep_until(self, deadline: float) -> None:
        """Return at `deadline`, or at once if it has passed."""
        ...


class RealClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        return time.monotonic()

    def sleep_until(self, deadline: float) -> None:
        remaining = deadline - time.monotonic()
        if remaining > 0.0:
            time.sleep(remaining)


class SteppedClock:
    """A clock that moves only when somebody waits on it or advances it."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        return self._now

    def sleep_until(self, deadline: float) -> None:
        self._now = max(self._now, deadline)

    def advance(self, seconds: float) -> None:
        """Move the clock forward by `seconds` (0 or more)."""
        if not seconds >= 0.0:
            raise ValueError(f"seconds is {seconds}: a clock only goes forward")
        self._now += seconds


class Ticker:
    """Absolute deadlines at a fixed period: one late cycle does not delay the next.

    `wait` returns the number of deadlines that were missed (0 when on time). Deadlines are start + n *
    period, never last + period, so lateness does not accumulate.
    """

    def __init__(self, period: float, clock: Clock) -> None:
        if not period > 0.0:
            raise ValueError(f"period is {period} s: it must be above 0")
        self._period = period
        self._clock = clock
        self._start = clock.now()
        self._count = 0

    def wait(self) -> int:
        self._count += 1
        elapsed = self._clock.now() - self._start
        missed = int(elapsed / self._period) - self._count
        if missed > 0:
            self._count += missed
        self._clock.sleep_until(self._start + self._count * self._period)
        return max(missed, 0)
