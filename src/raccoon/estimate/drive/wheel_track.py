"""One wheel's present angle and speed, from a counter and a back-EMF word that are late.

The board filters the back-EMF, and its counter sums the filtered value, so both lag. For a first-order filter
the present angle is, except for the change of the last sample::

    angle = counter + lag * filtered speed

A whole tick is as much as a wheel turns in a cycle. So the fine back-EMF is integrated, and the integral
follows the counter: missed cycles are not lost, and ticks make no steps.
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
"""rad by which either counter or back-EMF turned while the other one stood still, after which the latter
counts as dead."""
STUCK_MEMORY_S = 10.0
"""s, time constant of this evidence: words are whole counts, and the start may be minutes ago."""
MAX_WORD_PERIOD_S = 0.012
"""s, longest time between two consecutive back-EMF words; in faster cycles some have none."""
CYCLE_GAP_S = 0.1
"""s between two cycles above which the wheel counts as unobserved; only the counter tells how far it
turned."""
HOLD_S = 0.06
"""s for which a silent wheel is assumed to keep its speed."""


class WheelTrack:
    """Angle increments (rad) and speed (rad/s) of one wheel at nominal scale.

    lag: s by which back-EMF and counter are behind the wheel (`wheels.lag_seconds`).
    increment: rad in the last cycle. speed: rad/s now, smoothed. settled_speed: rad/s, averaged over 0.1 s.
    step_speed: rad/s, mean over the filter's last step; set by the filter.
    silence: s without a reading. has_bemf: whether back-EMF was read, which has no tick steps.
    blind_time: s of the filter's present step in which the back-EMF was within the device's dead zone.
    guessed_angle: rad of it, with sign, that were guessed and that no counter corrects.
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
        self._filtered_before_silence: float | None = None  # its last value before a silence
        self._counter_ahead = 0.0
        self._speed_before_silence = 0.0  # rad/s, at the beginning of a silence
        self.increment = 0.0
        self.step_speed = 0.0
        self.speed = 0.0
        self.settled_speed = 0.0
        self.silence = 0.0
        self.has_bemf = False
        self.stuck_source = ""
        self._bemf_angle = self._counter_angle = 0.0
        # last back-EMF, rad/s, and s for which it is unchanged
        self._last_bemf_speed = self._repeated_seconds = 0.0

    def update(self, dt: float, speed: float | None, angle: float | None, unseen: float = 0.0) -> None:
        """Take one cycle of dt s: the filtered speed (rad/s) and the counter's increment (rad); either may be
        None.

        unseen: s of cycles before it without any reading.
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
        """Whether the back-EMF is dead like the counter: it shows a turning wheel, and has repeated the same
        value for so long that a working one's noise would have changed it. (Synthetic words may repeat as
        well, but then the counter counts.)"""
        if speed != self._last_bemf_speed or abs(speed) < RESTING_SPEED:
            self._last_bemf_speed, self._repeated_seconds = speed, 0.0
            return False
        self._repeated_seconds += dt
        return self.stuck_source == "counter" and self._repeated_seconds > BEMF_FROZEN_SECONDS

    def _bridge(self, dt: float, speed: float | None, angle: float | None) -> None:
        """Take the first words after a silence."""
        if angle is None:
            self.guessed_angle = max(
                self.guessed_angle, self._guessed_angle(dt), key=abs
            )  # a restart may have set it already
            self.increment = 0.0
        else:
            before, now = self._filtered_before_silence if self._filtered is None else self._filtered, speed
            ahead = 0.0 if before is None or now is None else self.lag * (now - before)
            self.increment = angle + self._counter_ahead + ahead
        self._counter_ahead = 0.0
        self._bemf_angle = self._counter_angle = 0.0
        self._filtered, self._filtered_before_silence = speed, None
        self.has_bemf = speed is not None
        if speed is None and angle is not None and dt <= CYCLE_GAP_S:  # an encoder: the mean speed
            speed = angle / (self.silence + dt)
        self.speed = self.settled_speed = 0.0 if speed is None else speed
        self.silence = 0.0

    def take_counter_jump(self, dt: float) -> None:
        """Handle a jump of the counter or a restart of its controller, before `update`: the turn since the
        last reading stays a guess, and the board's filter may have restarted."""
        self.guessed_angle += self._guessed_angle(dt)
        self._counter_ahead = self._bemf_angle = self._counter_angle = 0.0
        self._filtered = None

    def _guessed_angle(self, dt: float) -> float:
        """rad that the wheel would have turned since its last reading at its speed then."""
        return (self._speed_before_silence if self.silence > 0.0 else self.speed) * (self.silence + dt)

    def _find_stuck_source(self, dt: float, speed: float, angle: float) -> None:
        """Find a dead source: it stands while the other one turns."""
        bemf_angle, counter_angle = speed * dt, angle
        # Sums with sign, so that a resting counter's ticks and the offset between them cancel. What both show
        # is no evidence: forget over about half a radian.
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
        """Take a speed. span: s since the one before."""
        before = speed if self._filtered is None else self._filtered
        self.increment = speed * dt + self._pull_to_counter(dt, speed, angle) + self.lag * (speed - before)
        self._filtered, self._filtered_before_silence = speed, None
        self.has_bemf = True
        # The filter's input, half a sample newer than the increment's middle.
        self._smooth(span, speed + (self.lag / max(span, MIN_PERIOD_S) + 0.5) * (speed - before))

    def _pull_to_counter(self, dt: float, speed: float, angle: float | None) -> float:
        """rad by which the integrated back-EMF follows the counter in this cycle."""
        if angle is None:
            return 0.0
        self._counter_ahead += angle - speed * dt
        pull = self._counter_ahead * dt / (COUNTER_PULL_S + dt)
        self._counter_ahead -= pull
        return pull

    def _hold_speed(self, dt: float) -> None:
        """Handle a cycle without a reading: keep the speed for a while; a counter that returns corrects the
        angle."""
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
