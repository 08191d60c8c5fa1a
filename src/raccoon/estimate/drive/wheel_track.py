"""One wheel's angle and speed now, from a counter and a back-EMF word that is late.

The board filters the back-EMF, and its counter sums the filtered value, so both lag. For a first-order filter
the angle now is, but for the change of the last sample::

    angle = counter + lag * filtered speed

A whole tick is as much as a wheel turns in a cycle, so the fine back-EMF is integrated and drawn to the
counter: no cycle that was missed is lost, and no tick's step is seen.
"""

from __future__ import annotations

from raccoon.core.readings import BEMF_FROZEN_SECONDS
from raccoon.estimate.drive.slip import RESTING_SPEED

SHORTEST = 0.002
"""s between two readings; closer ones are the same reading twice."""
COUNTER_PULL = 0.25
"""s, time constant with which the integrated back-EMF follows the counter."""
SPEED_SMOOTHING = 0.005
"""s, time constant of the speed handed to the speed loop."""
STUCK_ANGLE = 0.15
"""rad that one of counter and back-EMF turned while the other stood still: the other is dead."""
FORGOTTEN = 10.0
"""s in which such evidence is: words are cut to whole counts, and a start may be minutes away."""
BETWEEN = 0.012
"""s between two back-EMF words that follow each other; who looks more often sees none in between."""
GAP = 0.1
"""s between two cycles in which nobody saw what the wheel did; the counter alone tells how far it turned."""
HOLD = 0.06
"""s for which a silent wheel is taken to turn on as before."""


class WheelTrack:
    """Angle increments and speed of one wheel, rad and rad/s at nominal scale.

    lag: s by which back-EMF and counter are behind the wheel (`wheels.lag_seconds`).
    increment: rad in the last cycle. speed: rad/s now, smoothed. settled: rad/s, averaged over 0.1 s.
    mean: rad/s over the filter's last step, kept here for it.
    silent: s without a reading. fine: True where back-EMF was read, which carries no steps.
    blind: s of the filter's present step, kept here for it, in which the back-EMF was within the device's
    dead zone. lost: rad in it, with their sign, that were guessed and that no counter corrects.
    """

    __slots__ = (
        "_before",
        "_behind",
        "_filtered",
        "_moved",
        "_repeated",
        "_said",
        "_turned",
        "_went",
        "blind",
        "fine",
        "increment",
        "lag",
        "lost",
        "mean",
        "settled",
        "silent",
        "speed",
        "stuck",
    )

    def __init__(self, lag: float) -> None:
        self.lag = lag
        self.blind = self.lost = 0.0
        self._filtered: float | None = None
        self._before: float | None = None  # what it was before it fell silent
        self._behind = 0.0
        self._went = 0.0  # rad/s, as it fell silent
        self.increment = 0.0
        self.mean = 0.0
        self.speed = 0.0
        self.settled = 0.0
        self.silent = 0.0
        self.fine = False
        self.stuck = ""
        self._turned = self._moved = 0.0
        self._said, self._repeated = 0.0, 0.0  # the last back-EMF, rad/s, and s for which it has been so

    def update(self, dt: float, speed: float | None, angle: float | None, unseen: float = 0.0) -> None:
        """Take one cycle of dt s: the filtered speed and the counter's increment, either may be absent.

        unseen: s of cycles before it in which nothing at all was read.
        """
        if speed is not None and self._is_frozen(dt, speed):
            speed = angle = None
        if (dt > GAP or max(unseen, self.silent) > HOLD) and not (speed is None and angle is None):
            self._bridge(dt, speed, angle)
            return
        between = self.silent if self.silent <= BETWEEN else 0.0
        if speed is not None and angle is not None:
            self._compare(between + dt, speed, angle)
            if self.stuck == "counter":
                angle = None
            elif self.stuck == "back-EMF":
                speed = None
        if speed is not None:
            self._from_back_emf(dt, speed, angle, between + dt)
        elif angle is not None and self.fine and self.silent + dt <= BETWEEN:
            self._behind += angle
            self._hold(dt)
            return
        elif angle is not None:
            self.fine = False
            self.increment = angle + self._behind
            self._behind = 0.0
            self._filtered = None
            self._smooth(dt, self.increment / dt if dt > 0.0 else self.speed)
        else:
            self._hold(dt)
            return
        self.silent = 0.0

    def _is_frozen(self, dt: float, speed: float) -> bool:
        """Whether the back-EMF is as dead as the counter: it says that the wheel turns, and has for long said
        the very same, which noise changes in every one that works. (Made-up words may repeat themselves as
        well, but their counter counts.)
        """
        if speed != self._said or abs(speed) < RESTING_SPEED:
            self._said, self._repeated = speed, 0.0
            return False
        self._repeated += dt
        return self.stuck == "counter" and self._repeated > BEMF_FROZEN_SECONDS

    def _bridge(self, dt: float, speed: float | None, angle: float | None) -> None:
        """Take the first words after a time in which there were none."""
        if angle is None:
            self.lost = max(self.lost, self._unknown(dt), key=abs)  # a restart has told of it already
            self.increment = 0.0
        else:
            before, now = self._before if self._filtered is None else self._filtered, speed
            ahead = 0.0 if before is None or now is None else self.lag * (now - before)
            self.increment = angle + self._behind + ahead
        self._behind = 0.0
        self._turned = self._moved = 0.0
        self._filtered, self._before = speed, None
        self.fine = speed is not None
        if speed is None and angle is not None and dt <= GAP:  # an encoder: it went on as on the mean
            speed = angle / (self.silent + dt)
        self.speed = self.settled = 0.0 if speed is None else speed
        self.silent = 0.0

    def restart(self, dt: float) -> None:
        """The counter jumped, or its controller restarted: what the wheel turned since the last reading stays
        guessed, and the board's filter may have begun anew. Before `update`.
        """
        self.lost += self._unknown(dt)
        self._behind = self._turned = self._moved = 0.0
        self._filtered = None

    def _unknown(self, dt: float) -> float:
        """rad that it would have turned since its last reading at the speed that it had then."""
        return (self._went if self.silent > 0.0 else self.speed) * (self.silent + dt)

    def _compare(self, dt: float, speed: float, angle: float) -> None:
        """Find the one of both that is dead: it stands while the other turns."""
        turned, moved = speed * dt, angle
        # Summed with their signs, so that a resting counter's ticks and the offset between them cancel. What
        # both say is no evidence: forget over about half a radian.
        both = min(abs(turned), abs(moved)) + 0.1 * max(abs(turned), abs(moved))
        keep = 1.0 - min(1.0, 2.0 * both + dt / FORGOTTEN)
        self._turned = (self._turned + turned) * keep
        self._moved = (self._moved + moved) * keep
        alone = abs(self._turned) - abs(self._moved)
        if alone > STUCK_ANGLE:
            self.stuck = "counter"
        elif alone < -STUCK_ANGLE:
            self.stuck = "back-EMF"
        elif abs(alone) < 0.5 * STUCK_ANGLE:
            self.stuck = ""

    def _from_back_emf(self, dt: float, speed: float, angle: float | None, span: float) -> None:
        """Take a speed; span: s since the one before."""
        before = speed if self._filtered is None else self._filtered
        self.increment = speed * dt + self._pull(dt, speed, angle) + self.lag * (speed - before)
        self._filtered, self._before = speed, None
        self.fine = True
        # The filter's input, half a sample newer than the increment's middle.
        self._smooth(span, speed + (self.lag / max(span, SHORTEST) + 0.5) * (speed - before))

    def _pull(self, dt: float, speed: float, angle: float | None) -> float:
        """rad by which the counter draws the integrated back-EMF to itself in this cycle."""
        if angle is None:
            return 0.0
        self._behind += angle - speed * dt
        pull = self._behind * dt / (COUNTER_PULL + dt)
        self._behind -= pull
        return pull

    def _hold(self, dt: float) -> None:
        """Nothing was read: turn on as before for a while; a counter that comes back corrects it."""
        if self.silent == 0.0:
            self._went = self.speed
        self.silent += dt
        self.increment = self.speed * dt if self.silent <= HOLD else 0.0
        self._behind -= self.increment
        if self.silent > HOLD:
            if self._filtered is not None:
                self._before = self._filtered
            self._filtered = None
            self.speed = self.settled = 0.0

    def _smooth(self, dt: float, now: float) -> None:
        self.speed += (now - self.speed) * dt / (SPEED_SMOOTHING + dt)
        self.settled += (now - self.settled) * dt / (0.1 + dt)
