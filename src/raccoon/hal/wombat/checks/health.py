"""Health checks on a controller's words: staleness, IMU, motors and battery.

Each watcher checks one thing, is updated once a cycle and returns whether it is wrong now. None of them
depends on the firmware; none reads a clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.core.readings import BEMF_VOLTS_PER_COUNT, GRAVITY, MOTOR_PORTS, Vector


class Liveness:
    """Whether words still change, compared with their usual rate of change.

    Noise changes the low bits of a live controller all the time; how often depends on the build. So the limit
    is `patience` times the mean interval between changes, bounded by `shortest` and `longest` seconds. A
    pause without updates does not count.
    """

    PAUSE = 0.1
    """s between two updates from which they count as a pause."""

    def __init__(self, shortest: float, longest: float, patience: float = 10.0) -> None:
        self._shortest, self._longest, self._patience = shortest, longest, patience
        self._last: bytes | None = None
        self._changed_at = 0.0
        self._first = self._looked = 0.0
        self._changes = 0
        self.fresh = False
        self.age = 0.0

    def update(self, words: bytes, time: float) -> bool:
        """Whether the words are the same for too long. Sets `fresh`: they are new in this cycle."""
        unseen, self._looked = time - self._looked, time
        if unseen > self.PAUSE:
            self._first += unseen
            self._changed_at += unseen
        self.fresh = words != self._last
        if self.fresh:
            if self._last is None:
                self._first = time
            else:
                self._changes += 1
            self._last, self._changed_at = words, time
        self.age = time - self._changed_at
        return self.age > self.limit

    @property
    def limit(self) -> float:
        """The longest time without a change, s."""
        if self._changes < 5:
            return self._longest
        usual = (self._changed_at - self._first) / self._changes
        return min(max(self._patience * usual, self._shortest), self._longest)

    @property
    def rate_hz(self) -> float | None:
        """Changes a second since the start."""
        elapsed = self._changed_at - self._first
        return self._changes / elapsed if self._changes >= 5 and elapsed > 0.0 else None


class LifeWatch:
    """Detects a controller whose main loop hangs: it gives no sign of life although it must.

    The low bits of ADC and IMU show life but need not: filters suppress noise, an IMU may be dead or read
    once a second. Turning wheels always show it, in the counters. So silence means something only if the
    wheels turned at the last sign of life, or if the motors are driven and do not start. At rest silence may
    last; a pause without updates does not count.

    silence: s without a sign of life although one was due.
    """

    TURNING = 64.0
    """Back-EMF in counts from which a wheel cannot stop within one period of the words."""
    DRIVEN = 0.25
    """Duty from which any motor turns."""
    WHILE_TURNING, FROM_REST, GENTLY_FROM_REST = (0.05, 0.2), (0.3, 0.5), (0.5, 1.0)
    """s of silence from which the words are stale, and s from which the controller hangs."""
    LONGEST_LOOK = 0.04
    """Longest part of the time between two updates that counts as silence, s."""

    def __init__(self) -> None:
        self._last: bytes | None = None
        self._turning = False
        self._limits = self.WHILE_TURNING
        self._since = self._looked = 0.0
        self.silence = 0.0

    def update(self, words: bytes, time: float, bemf: Sequence[float], duties: Sequence[float]) -> None:
        """Update. bemf: counts, last known before this cycle. duties: those that drove the motors until
        now."""
        self._since += max(time - self._looked - self.LONGEST_LOOK, 0.0)
        self._looked = time
        if words != self._last:
            self._last, self._since = words, time
            self._turning = max(map(abs, bemf)) > self.TURNING
        elif not (self._turning or any(duties)):
            self._since = time
        self.silence = time - self._since
        if self._turning:
            self._limits = self.WHILE_TURNING
        else:
            driven = max(map(abs, duties)) >= self.DRIVEN
            self._limits = self.FROM_REST if driven else self.GENTLY_FROM_REST

    @property
    def is_stale(self) -> bool:
        """Whether the words are old although they look new."""
        return self.silence > self._limits[0]

    @property
    def has_hung(self) -> bool:
        """Whether the controller hangs and must be given up."""
        return self.silence > self._limits[1]


class ImuWatch:
    """Whether the IMU's words are plausible (turn rate, and gravity of about 1 g) and usable: if the
    controller stands on edge, its vertical axis does not measure the robot's turn.

    Rates are rad/s, accelerations m/s2. A robot with its motors off may still turn if somebody moves it or
    bumps into it, but less fast than a gyro that wanders.
    """

    FASTEST = 10.0
    FASTEST_AT_REST = 6.0
    GRAVITY_RANGE = (4.9, 14.7)
    MAX_FORCE = 70.0
    """4 g on three axes, the range of the chip. A damaged frame may contain any number, or NaN."""
    MIN_UPRIGHT = 4.9
    SMOOTHING = 0.05
    PENALTY_SECONDS = 1.0
    OFFENCES, FORGIVEN = 3.0, 0.2

    def __init__(self) -> None:
        self._gravity = GRAVITY
        self._upright: float | None = None
        self._until = -math.inf
        self._rest_failed = False
        self._wrong = False
        self._score = 0.0

    def is_distrusted(self, time: float) -> bool:
        """Whether the words are, or lately were, impossible. If they failed at rest, only good words at rest
        clear it."""
        return self._wrong or self._rest_failed or time < self._until

    def update(self, gyro: Vector, accel: Vector, at_rest: bool, time: float) -> None:
        """Check new words; gyro in rad/s, accel in m/s2."""
        norm = math.sqrt(accel[0] * accel[0] + accel[1] * accel[1] + accel[2] * accel[2])
        felt = norm <= self.MAX_FORCE
        if felt:
            self._gravity += self.SMOOTHING * (norm - self._gravity)
            before = accel[2] if self._upright is None else self._upright
            self._upright = before + self.SMOOTHING * (accel[2] - before)
        upright = self._upright is None or abs(self._upright) >= self.MIN_UPRIGHT
        low, high = self.GRAVITY_RANGE
        most = self.FASTEST_AT_REST if at_rest else self.FASTEST
        x, y, z = gyro
        turns = -most <= x <= most and -most <= y <= most and -most <= z <= most
        self._wrong = not (felt and upright and turns and low <= self._gravity <= high)
        if not self._wrong:
            self._score = max(self._score - self.FORGIVEN, 0.0)
            if at_rest and time >= self._until:
                self._rest_failed = False
            return
        self._score += 1.0
        if self._score >= self.OFFENCES:  # a damaged frame is one offence, a broken IMU goes on
            self._until = time + self.PENALTY_SECONDS
            self._rest_failed = self._rest_failed or at_rest


class MotorWatch:
    """Detects a driven motor without back-EMF: stalled, unplugged, or its fuse or driver has tripped.

    The driver reports nothing, so this contradiction is the only sign. A motor that was turning is detected
    within a few cycles; one that starts or accelerates gets more time. After a pause every motor counts as
    starting, because the supervisor may have stopped it.
    """

    DRIVEN = 0.25
    SHARE = 0.3
    """Threshold as a share of the back-EMF that a free motor has at the recent duties."""
    LATELY = 0.1
    """Time constant of the smoothed duty, s: the time in which a wheel follows its duty."""
    SECONDS_FROM_MOTION = 0.02
    SECONDS_FROM_REST = 0.25
    USUAL_BATTERY = 6.6
    PAUSE = 0.1
    """s between two cycles from which they count as a pause."""

    def __init__(self) -> None:
        self._signs = [0] * MOTOR_PORTS
        self._turned = [False] * MOTOR_PORTS
        self._since = [math.inf] * MOTOR_PORTS
        self._last_motion = [0.0] * MOTOR_PORTS
        self._time = 0.0

    def update(self, duties: Sequence[float], bemf: Sequence[float], time: float) -> bool:
        """Whether any motor is at fault. duties: those that drove the motors until now. bemf: counts."""
        wrong = False
        dt, self._time = time - self._time, time
        if dt > self.PAUSE:  # the back-EMF read now may be a mean over the pause
            self._signs, self._last_motion = [0] * MOTOR_PORTS, list(duties)
            return False
        share = dt / (self.LATELY + dt) if dt > 0.0 else 0.0
        for port, duty in enumerate(duties):
            self._last_motion[port] += share * (duty - self._last_motion[port])
            if -self.DRIVEN < duty < self.DRIVEN:
                self._signs[port] = 0
            elif self._is_at_fault(port, duty, bemf[port], time):
                wrong = True
        return wrong

    def _is_at_fault(self, port: int, duty: float, bemf: float, time: float) -> bool:
        sign = 1 if duty > 0.0 else -1
        if sign != self._signs[port]:
            self._signs[port], self._turned[port], self._since[port] = sign, False, time
        least = min(sign * duty, max(sign * self._last_motion[port], 0.0))
        per_duty = self.SHARE * self.USUAL_BATTERY / BEMF_VOLTS_PER_COUNT
        if bemf * sign >= least * per_duty:
            # Just after a reversal `least` is 0: a reading above it is no proof of motion yet.
            self._turned[port] = self._turned[port] or bemf * sign >= self.DRIVEN * per_duty
            self._since[port] = time
            return False
        patience = self.SECONDS_FROM_MOTION if self._turned[port] else self.SECONDS_FROM_REST
        return time - self._since[port] > patience


class RestWatch:
    """Detects motors that report motion without a command: an offset of the back-EMF conversion.

    An offset adds up to phantom distance. It is told from coasting by its constant reading. known: the
    calibrated offset of each motor, counts, which is compensated and so causes none.
    """

    SETTLE = 0.3
    """s without a command and without a change after which the motors are at rest."""
    STEADY = 15.0
    """Largest difference from the smoothed reading of a steady motor, counts."""
    SMOOTHING = 0.05
    LARGEST = 12.0
    """Largest difference of the smoothed reading from the known offset, counts."""

    def __init__(self, known: Sequence[float] = (0.0,) * MOTOR_PORTS) -> None:
        self._since: float | None = -math.inf  # before the first command the motors are at rest
        self._known = tuple(known)
        self._smooth = list(known)
        self.offset = list(known)

    def update(self, duties: Sequence[float], bemf: Sequence[float], time: float) -> bool:
        """Whether a motor at rest reports motion. `offset`: the latest readings at rest, counts, smoothed."""
        steady = True
        for port, value in enumerate(bemf):
            error = value - self._smooth[port]
            self._smooth[port] += self.SMOOTHING * error
            steady = steady and -self.STEADY < error < self.STEADY
        if any(duties) or not steady:
            self._since = None
        elif self._since is None:
            self._since = time
        elif self.is_resting(time):
            self.offset = list(self._smooth)
        return any(map(self._moves, self.offset, self._known))

    def _moves(self, offset: float, known: float) -> bool:
        # A dead zone may hide a known offset: a reading near 0 is right, too.
        return abs(offset) > self.LARGEST and abs(offset - known) > self.LARGEST

    def is_resting(self, time: float) -> bool:
        """Whether the motors have been at rest for longer than `SETTLE`."""
        return self._since is not None and time - self._since > self.SETTLE
