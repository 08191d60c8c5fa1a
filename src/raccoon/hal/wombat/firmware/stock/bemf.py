"""Back-EMF of the stock firmware, which shows it in its counters alone."""

from __future__ import annotations

import math

from raccoon.core.readings import MOTOR_PORTS
from raccoon.hal.wombat.firmware.counters import Bemf, Counts


class StockBemf:
    """Back-EMF out of the stock firmware's counters, which is all it shows of it.

    Every update of the firmware adds the filtered back-EMF f to the counter, so whoever looks at least once
    an update sees f itself as a difference. Looked at more rarely, a difference holds several f; their number
    follows from the time passed and, where that leaves a choice, from the last f. A filter that loses at most
    a quarter of its value an update cannot fall from a real speed to 0 at once: a counter that stands still
    then has not been updated.

    Its integer arithmetic drops 0, 1/4, 1/2 or 3/4 count towards 0 at each update, 3/8 on average, which a
    filter of weight 1/4 shows as `TRUNCATION` counts too little in magnitude, in its value and in its sums.
    `value` and `shortfall` make up for that; the dither it takes is the noise of the converter.
    """

    TRUNCATION = 1.5
    SURELY_STOPPED = 16
    """Counts: f may drop to 0 from here, its dead zone being 10 and its decay 3/4."""
    STOPPED_BY_FORCE = 64
    """Counts: f may drop to 0 from here where the motor is driven back at the same moment."""
    NEXT, MISSED = 1.3, 2.6
    """Updates after which the next one must have come, and after which two are missing."""
    MANY = 12
    """Updates in which f falls from any speed to where it may drop to 0: a difference that holds as many is a
    mean of what was, and tells nothing of now."""
    SURE = 0.2
    """Updates: what the time has room for is the whole number of them that it is nearer to than that."""
    OWED = 0.3
    """Updates: as much of that as is kept, since no rate is known exactly and the loop is not even."""

    def __init__(self, rate_hz: float) -> None:
        self._period = 1.0 / rate_hz
        self._since_news = 0.0
        self.value: Bemf = (0.0, 0.0, 0.0, 0.0)
        self.fresh = False
        self.shortfall = [0.0] * MOTOR_PORTS
        """Counts that truncation has kept from each counter so far."""
        self._standing = False  # as was told
        self._owed_counts = 0.0  # updates that the time so far had room for beyond those that were counted
        self._updates = 0
        self._seconds = 0.0
        self.averaged = False
        """Whether `value` is a mean of so many updates that f may be anything by now."""

    def update(self, differences: Counts, seconds: float) -> None:
        """Take what the counters did in the last `seconds`. `fresh` tells whether `value` is new."""
        self._since_news += seconds
        fastest = 0.0 if self.averaged else max(map(abs, self.value))
        moving = fastest > self.SURELY_STOPPED
        if not any(differences):
            patience = self.MISSED if moving else self.NEXT
            due = self._standing or self._since_news > patience * self._period
            self.fresh = fastest <= self.STOPPED_BY_FORCE and due
            if self.fresh:  # the updates so far added nothing: none of them is in the next difference
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
        """Begin to count the time anew: of what the counters did so far, what comes now holds nothing."""
        self._since_news = self._owed_counts = 0.0

    def begin_anew(self) -> None:
        """The firmware has restarted, and its filter holds nothing: counters that stand now are not late, as
        the wheels may have come to rest meanwhile."""
        self.restart()
        self.value, self.averaged, self._standing = (0.0, 0.0, 0.0, 0.0), False, False

    def _makes_up(self, port: int, difference: int, updates: int) -> float:
        if difference == 0:
            return 0.0
        missing = math.copysign(self.TRUNCATION, difference)
        self.shortfall[port] += updates * missing
        return difference / updates + missing

    def _count(self, differences: Counts) -> int:
        """How many updates the differences hold, by the time and, where it leaves a choice, by their size.

        Their size alone would do it wrong for ever: once the speed is taken for twice what it is, two updates
        are twice as fast a wheel's one.
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
