"""Plausibility checks of the gyro, and the list of reasons not to trust an estimate."""

from __future__ import annotations

import math

from raccoon.core.readings import Fault, Inputs

GYRO_TIMEOUT_S = 0.1
"""s without a gyro reading after which it counts as lost."""
GYRO_FULL_SCALE = 34.0
"""rad/s; the gyros of these robots end at 2000 degrees a second (34.9 rad/s)."""
FROZEN_REPEATS = 12
"""Number of equal readings in a row that a gyro with noise never gives."""
SUSPICIOUS_REPEATS = 4
"""Number of equal readings in a row that is suspicious if the wheels disagree: with noise of one word on each
axis, two occur once in 40 cycles, five once in a million."""
NOISY_CHANGES = 50
"""Number of changes from one reading to the next after which a gyro is known to have noise."""
SHOWN_FOR_S = 0.3
"""s for which a reason stays after its cause has passed."""


class Reasons:
    """Reasons why an estimate is not ok; each stays for a moment after it was last reported."""

    __slots__ = ("_until", "now")

    def __init__(self) -> None:
        self._until: dict[str, float] = {}
        self.now: tuple[str, ...] = ()

    def tell(self, reason: str, time: float, seconds: float = SHOWN_FOR_S) -> None:
        """Report that `reason` holds at `time`, and for `seconds` after it."""
        self._until[reason] = time + seconds
        if reason not in self.now:
            self.now = (*self.now, reason)

    def drop_expired(self, time: float) -> None:
        """Drop the expired reasons, also if time ran back."""
        if not self.now:
            return
        kept = {
            reason: until
            for reason, until in self._until.items()
            if time <= until <= time + 60.0 + SHOWN_FOR_S
        }
        if len(kept) != len(self._until):
            self._until = kept
            self.now = tuple(kept)


class GyroWatch:
    """Checks every gyro reading.

    age: s since a usable reading. repeats: how often the last one was repeated exactly.
    """

    __slots__ = ("_changes", "_last", "age", "repeats", "seen")

    def __init__(self) -> None:
        self._last: tuple[float, float, float] | None = None
        self._changes = 0
        self.age = math.inf
        self.repeats = 0
        self.seen = False

    def judge(self, dt: float, inputs: Inputs, reasons: Reasons) -> float | None:
        """The gyro's turn rate in this cycle, rad/s; None if there is no usable one."""
        self.age += dt
        rate = inputs.turn_rate
        if rate is None:
            if self.seen and self.age > GYRO_TIMEOUT_S:
                reasons.tell("the gyro is silent", inputs.time)
            return None
        if not math.isfinite(rate):
            reasons.tell("the gyro's reading is not a number", inputs.time)
            return None
        if abs(rate) >= GYRO_FULL_SCALE:
            reasons.tell("the gyro is at full scale", inputs.time)
            return None
        if self._is_frozen(inputs):
            reasons.tell("the gyro is frozen", inputs.time)
            return None
        self.seen = True
        return rate

    def _is_frozen(self, inputs: Inputs) -> bool:
        if inputs.gyro == self._last:
            self.repeats += 1
        else:
            self.repeats = 0
            self._last = inputs.gyro
            self._changes += 1
        announced = bool(inputs.faults) and Fault.IMU_FROZEN in inputs.faults
        lively = self._changes > NOISY_CHANGES
        return announced or (lively and self.repeats >= FROZEN_REPEATS)
