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

MIN_PERIOD_S = 0.002
"""s between two readings; closer ones are the same reading twice."""
COUNTER_PULL_S = 0.25
"""s, time constant with which the integrated back-EMF follows the counter."""
SPEED_SMOOTHING_S = 0.005
"""s, time constant of the speed handed to the speed loop."""
STUCK_ANGLE = 0.15
"""rad that one of counter and back-EMF turned while the other stood still: the other is dead."""
STUCK_MEMORY_S = 10.0
"""s in which such evidence is: words are cut to whole counts, and a start may be minutes away."""
MAX_WORD_PERIOD_S = 0.012
"""s between two back-EMF words that follow each other; who looks more often sees none in between."""
CYCLE_GAP_S = 0.1
"""s between two cycles in which nobody saw what the wheel did; the counter alone tells how far it turned."""
HOLD_S = 0.06
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
        "_bemf_angle",
        "_counter_ahead",
        "_counter_angle",
        "_filtered",
        "_filtered_before_silence",
        "_last_bemf_speed",
        "_repeated_seconds",
        "_speed_before_silence",
        "blind_time",
        "guessed_angle",
        "has_bemf",
        "increment",
        "lag",
        "settled_speed",
        "silence",
        "speed",
        "step_speed",
        "stuck_source",
    )

    def __init__(self, lag: float) -> None:
        self.lag = lag
        self.blind_time = self.guessed_angle = 0.0
        self._filtered: float | None = None
        self._filtered_before_silence: float | None = None  # what it was before it fell silent
        self._counter_ahead = 0.0
        self._speed_before_silence = 0.0  # rad/s, as it fell silent
        self.increment = 0.0
        self.step_speed = 0.0
        self.speed = 0.0
        self.settled_speed = 0.0
        self.silence = 0.0
        self.has_bemf = False
        self.stuck_source = ""
        self._bemf_angle = self._counter_angle = 0.0
        self._last_bemf_speed = self._repeated_seconds = 0.0  # the last back-EMF, rad/s, and s since it is so

    def update(self, dt: float, speed: float | None, angle: float | None, unseen: float = 0.0) -> None:
        """Take one cycle of dt s: the filtered speed and the counter's increment, either may be absent.

        unseen: s of cycles before it in which nothing at all was read.
        """
        if speed is not None and self._is_frozen(dt, speed):
            speed = angle = None
        if (dt > CYCLE_GAP_S or max(unseen, self.silence) > HOLD_S) and not (speed is None and angle is None):
            self._bridge(dt, speed, angle)
            return
        word_gap = self.silence if self.silence <= MAX_WORD_PERIOD_S else 0.0
        if speed is not None and angle is not None:
            self._find_stuck_source(word_gap + dt, speed, angle)
            if self.stuck_source == "counter":
                angle = None
            elif self.stuck_source == "back-EMF":
                speed = None
        if speed is not None:
            self._take_back_emf(dt, speed, angle, word_gap + dt)
        elif angle is not None and self.has_bemf and self.silence + dt <= MAX_WORD_PERIOD_S:
            self._counter_ahead += angle
            self._hold_speed(dt)
            return
        elif angle is not None:
            self.has_bemf = False
            self.increment = angle + self._counter_ahead
            self._counter_ahead = 0.0
            self._filtered = None
            self._smooth(dt, self.increment / dt if dt > 0.0 else self.speed)
        else:
            self._hold_speed(dt)
            return
        self.silence = 0.0

    def _is_frozen(self, dt: float, speed: float) -> bool:
        """Whether the back-EMF is as dead as the counter: it says that the wheel turns, and has for long said
        the very same, which noise changes in every one that works. (Made-up words may repeat themselves as
        well, but their counter counts.)
        """
        if speed != self._last_bemf_speed or abs(speed) < RESTING_SPEED:
            self._last_bemf_speed, self._repeated_seconds = speed, 0.0
            return False
        self._repeated_seconds += dt
        return self.stuck_source == "counter" and self._repeated_seconds > BEMF_FROZEN_SECONDS

    def _bridge(self, dt: float, speed: float | None, angle: float | None) -> None:
        """Take the first words after a time in which there were none."""
        if angle is None:
            self.guessed_angle = max(
                self.guessed_angle, self._guessed_angle(dt), key=abs
            )  # a restart has told of it already
            self.increment = 0.0
        else:
            before, now = self._filtered_before_silence if self._filtered is None else self._filtered, speed
            ahead = 0.0 if before is None or now is None else self.lag * (now - before)
            self.increment = angle + self._counter_ahead + ahead
        self._counter_ahead = 0.0
        self._bemf_angle = self._counter_angle = 0.0
        self._filtered, self._filtered_before_silence = speed, None
        self.has_bemf = speed is not None
        if speed is None and angle is not None and dt <= CYCLE_GAP_S:  # an encoder: it went on as on the mean
            speed = angle / (self.silence + dt)
        self.speed = self.settled_speed = 0.0 if speed is None else speed
        self.silence = 0.0

    def take_counter_jump(self, dt: float) -> None:
        """The counter jumped, or its controller restarted: what the wheel turned since the last reading stays
        guessed, and the board's filter may have begun anew. Before `update`.
        """
        self.guessed_angle += self._guessed_angle(dt)
        self._counter_ahead = self._bemf_angle = self._counter_angle = 0.0
        self._filtered = None

    def _guessed_angle(self, dt: float) -> float:
        """rad that it would have turned since its last reading at the speed that it had then."""
        return (self._speed_before_silence if self.silence > 0.0 else self.speed) * (self.silence + dt)

    def _find_stuck_source(self, dt: float, speed: float, angle: float) -> None:
        """Find the one of both that is dead: it stands while the other turns."""
        bemf_angle, counter_angle = speed * dt, angle
        # Summed with their signs, so that a resting counter's ticks and the offset between them cancel. What
        # both say is no evidence: forget over about half a radian.
        common = min(abs(bemf_angle), abs(counter_angle)) + 0.1 * max(abs(bemf_angle), abs(counter_angle))
        keep = 1.0 - min(1.0, 2.0 * common + dt / STUCK_MEMORY_S)
        self._bemf_angle = (self._bemf_angle + bemf_angle) * keep
        self._counter_angle = (self._counter_angle + counter_angle) * keep
        difference = abs(self._bemf_angle) - abs(self._counter_angle)
        if difference > STUCK_ANGLE:
            self.stuck_source = "counter"
        elif difference < -STUCK_ANGLE:
            self.stuck_source = "back-EMF"
        elif abs(difference) < 0.5 * STUCK_ANGLE:
            self.stuck_source = ""

    def _take_back_emf(self, dt: float, speed: float, angle: float | None, span: float) -> None:
        """Take a speed; span: s since the one before."""
        before = speed if self._filtered is None else self._filtered
        self.increment = speed * dt + self._pull_to_counter(dt, speed, angle) + self.lag * (speed - before)
        self._filtered, self._filtered_before_silence = speed, None
        self.has_bemf = True
        # The filter's input, half a sample newer than the increment's middle.
        self._smooth(span, speed + (self.lag / max(span, MIN_PERIOD_S) + 0.5) * (speed - before))

    def _pull_to_counter(self, dt: float, speed: float, angle: float | None) -> float:
        """rad by which the counter draws the integrated back-EMF to itself in this cycle."""
        if angle is None:
            return 0.0
        self._counter_ahead += angle - speed * dt
        pull = self._counter_ahead * dt / (COUNTER_PULL_S + dt)
        self._counter_ahead -= pull
        return pull

    def _hold_speed(self, dt: float) -> None:
        """Nothing was read: turn on as before for a while; a counter that comes back corrects it."""
        if self.silence == 0.0:
            self._speed_before_silence = self.speed
        self.silence += dt
        self.increment = self.speed * dt if self.silence <= HOLD_S else 0.0
        self._counter_ahead -= self.increment
        if self.silence > HOLD_S:
            if self._filtered is not None:
                self._filtered_before_silence = self._filtered
            self._filtered = None
            self.speed = self.settled_speed = 0.0

    def _smooth(self, dt: float, now: float) -> None:
        self.speed += (now - self.speed) * dt / (SPEED_SMOOTHING_S + dt)
        self.settled_speed += (now - self.settled_speed) * dt / (0.1 + dt)
