"""Back-EMF of the stock firmware, derived from its counters because it sends nothing else of it."""

from __future__ import annotations

import math

from raccoon.core.readings import MOTOR_PORTS
from raccoon.hal.wombat.firmware.counters import Bemf, Counts


class StockBemf:
    """Back-EMF from the stock firmware's counters, which are all that it shows of it.

    Every update of the firmware adds the filtered back-EMF f to the counter, so a reader that reads at least
    once per update sees f itself as a difference. With fewer readings a difference contains several f; their
    number follows from the elapsed time and, if that leaves a choice, from the last f. The filter loses at
    most a quarter of its value in an update, so it cannot fall from a real speed to 0 at once: a counter that
    stands still then has not been updated.

    Its integer arithmetic drops 0, 1/4, 1/2 or 3/4 count towards 0 at each update, 3/8 on average. In a
    filter of weight 1/4 this makes values and sums `TRUNCATION` counts too small in magnitude. `value` and
    `shortfall` compensate for that; the noise of the converter acts as the dither that this needs.
    """

    TRUNCATION = 1.5
    SURELY_STOPPED = 16
    """Largest f in counts that may drop to 0 in one update: the dead zone is 10 and the decay 3/4."""
    STOPPED_BY_FORCE = 64
    """Largest f in counts that may drop to 0 in one update if the motor is driven back at the same moment."""
    NEXT, MISSED = 1.3, 2.6
    """Time since the last update, in periods, after which the next one must have come, and after which two
    are missing."""
    MANY = 12
    """Number of updates in which f falls from any speed to where it may drop to 0: a difference over as many
    is a mean of the past and says nothing about the present."""
    SURE = 0.2
    """Tolerance in updates: an elapsed time this close to a whole number of periods leaves no choice."""
    OWED = 0.3
    """Largest remainder in updates that is carried over to the next count, since no rate is known exactly and
    the loop is uneven."""

    def __init__(self, rate_hz: float) -> None:
        self._period = 1.0 / rate_hz
        self._since_news = 0.0
        self.value: Bemf = (0.0, 0.0, 0.0, 0.0)
        self.fresh = False
        self.shortfall = [0.0] * MOTOR_PORTS
        """Counts that each counter lacks so far by truncation."""
        self._standing = False  # whether the last fresh value was standstill
        self._owed_counts = 0.0  # elapsed time in periods, minus the updates counted so far
        self._updates = 0
        self._seconds = 0.0
        self.averaged = False
        """Whether `value` is a mean of so many updates that f may be anything by now."""

    def update(self, differences: Counts, seconds: float) -> None:
        """Update with the differences of the counters in the last `seconds`. Sets `fresh`: whether `value` is
        new."""
        self._since_news += seconds
        fastest = 0.0 if self.averaged else max(map(abs, self.value))
        moving = fastest > self.SURELY_STOPPED
        if not any(differences):
            patience = self.MISSED if moving else self.NEXT
            due = self._standing or self._since_news > patience * self._period
            self.fresh = fastest <= self.STOPPED_BY_FORCE and due
            if self.fresh:  # the updates so far added nothing, so the next difference contains none of them
                self.value, self.averaged = (0.0, 0.0, 0.0, 0.0), False
                self._standing, self._since_news = True, 0.0
            return
        self._standing = False
        updates = self._count(differences)
        if moving:
            self._updates += updates
            self._seconds += self._since_news
        self._since_news = 0.0
        a, b, c, d = (self._makes_up(port, each, updates) for port, each in enumerate(differences))
        self.value = (a, b, c, d)
        self.averaged = updates >= self.MANY
        self.fresh = True

    def restart(self) -> None:
        """Restart the measurement of time: the next differences contain nothing from before."""
        self._since_news = self._owed_counts = 0.0

    def begin_anew(self) -> None:
        """Reset after a restart of the firmware, whose filter is empty then: counters that stand still are
        not late, because the wheels may have come to rest meanwhile."""
        self.restart()
        self.value, self.averaged, self._standing = (0.0, 0.0, 0.0, 0.0), False, False

    def _makes_up(self, port: int, difference: int, updates: int) -> float:
        if difference == 0:
            return 0.0
        missing = math.copysign(self.TRUNCATION, difference)
        self.shortfall[port] += updates * missing
        return difference / updates + missing

    def _count(self, differences: Counts) -> int:
        """Number of updates in the differences, from the elapsed time and, if that leaves a choice, from
        their size.

        The size alone could stay wrong for ever: once the speed is taken for twice its value, two updates
        look like one of a wheel twice as fast.
        """
        periods = self._since_news / self._period
        port = max(range(MOTOR_PORTS), key=lambda each: abs(self.value[each]))
        if self.averaged or abs(self.value[port]) < 2 * self.SURELY_STOPPED:
            self._owed_counts = 0.0
            return 1 if periods < 1.5 else round(periods)
        due = periods + self._owed_counts
        ratio = differences[port] / self.value[port]
        low = max(math.floor(due + self.SURE), 1)
        high = max(math.ceil(due - self.SURE), low)
        count = low if abs(low - ratio) <= abs(high - ratio) else high
        self._owed_counts = max(-self.OWED, min(self.OWED, due - count))
        return count

    @property
    def overdue(self) -> bool:
        """Whether counters that must move have stood still for more than two updates."""
        late = self._since_news > self.MISSED * self._period
        return late and max(map(abs, self.value)) > self.STOPPED_BY_FORCE

    @property
    def rate_hz(self) -> float | None:
        """Measured updates a second, None before half a second of motion."""
        return self._updates / self._seconds if self._seconds >= 0.5 else None
