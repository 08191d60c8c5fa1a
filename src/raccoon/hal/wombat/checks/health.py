"""What a controller's words tell about its health: staleness, IMU, motors and battery.

Each watcher looks at one thing, is fed once a cycle and answers whether it is wrong now. None of them knows
the firmware; none reads a clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.core.readings import BEMF_VOLTS_PER_COUNT, GRAVITY, MOTOR_PORTS, Vector


class Liveness:
    """Whether words still change, measured by how often they used to.

    Noise changes the low bits of a live controller all the time; how often depends on the build, so the limit
    is `patience` of the usual intervals, but within `shortest` and `longest` seconds. A pause in which nobody
    looked is none of them.
    """

    PAUSE = 0.1
    """s between two looks."""

    def __init__(self, shortest: float, longest: float, patience: float = 10.0) -> None:
        self._shortest, self._longest, self._patience = shortest, longest, patience
        self._last: bytes | None = None
        self._changed_at = 0.0
        self._first = self._looked = 0.0
        self._changes = 0
        self.fresh = False
        self.age = 0.0

    def update(self, words: bytes, time: float) -> bool:
        """True where the words have been the same for too long. `fresh`: they are new in this cycle."""
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
        """Seconds without a change that are too long."""
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
    """Whether a controller that must give a sign of life gives none: its main loop hangs.

    The low bits of ADC and IMU show life but need not: filters swallow noise, an IMU may be dead or read once
    a second. Turning wheels always show it, in the counters. So silence says something only of a robot whose
    wheels turned when it was last heard of, or that is driven and does not start. At rest it may last, and a
    pause in which nobody looked is none.

    silence: s without a sign of life that was due.
    """

    TURNING = 64.0
    """Back-EMF counts from which no wheel stops between two words."""
    DRIVEN = 0.25
    """Duty that turns any motor."""
    WHILE_TURNING, FROM_REST, GENTLY_FROM_REST = (0.05, 0.2), (0.3, 0.5), (0.5, 1.0)
    """s of silence after which words are stale, and after which the controller hangs."""
    LONGEST_LOOK = 0.04
    """s from one look to the next that count as silence, at most."""

    def __init__(self) -> None:
        self._last: bytes | None = None
        self._turning = False
        self._limits = self.WHILE_TURNING
        self._since = self._looked = 0.0
        self.silence = 0.0

    def update(self, words: bytes, time: float, bemf: Sequence[float], duties: Sequence[float]) -> None:
        """Take a cycle. bemf: counts, as last known before it. duties: what drove the motors until now."""
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
        """Whether the words are old ones that only look like new ones."""
        return self.silence > self._limits[0]

    @property
    def has_hung(self) -> bool:
        """Whether to give the controller up."""
        return self.silence > self._limits[1]


class ImuWatch:
    """Whether the IMU's words can be true: a plausible turn rate, and gravity about 1 g. And whether they can
    be used: where the controller stands on edge, its vertical axis does not tell how the robot turns.

    Rates are rad/s, forces m/s2. A robot whose motors are off may turn all the same, where
    somebody puts it right or knocks against it; but not as fast as a gyro that wanders.
    """

    FASTEST = 10.0
    FASTEST_AT_REST = 6.0
    GRAVITY_RANGE = (4.9, 14.7)
    MAX_FORCE = 70.0
    """4 g on three axes, the ends of the chip. A damaged frame may say anything, or no number at all."""
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
        """Whether the words are, or lately were, impossible. Who failed at rest is cleared at rest alone."""
        return self._wrong or self._rest_failed or time < self._until

    def update(self, gyro: Vector, accel: Vector, at_rest: bool, time: float) -> None:
        """Judge new words."""
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
    """A motor that is driven and gives no back-EMF: stalled, unplugged, or its fuse or driver has tripped.

    The driver reports nothing, so this disagreement is the only sign. A motor that was turning is missed
    within a few cycles; one that starts is given time, and so is one that is to turn faster. After a pause
    each of them starts: who stops the motors of a program that is late may have stopped it.
    """

    DRIVEN = 0.25
    SHARE = 0.3
    """Of the back-EMF that the duties of late make of a free motor."""
    LATELY = 0.1
    """s, as a wheel takes to follow its duty."""
    SECONDS_FROM_MOTION = 0.02
    SECONDS_FROM_REST = 0.25
    USUAL_BATTERY = 6.6
    PAUSE = 0.1
    """s between two cycles."""

    def __init__(self) -> None:
        self._signs = [0] * MOTOR_PORTS
        self._turned = [False] * MOTOR_PORTS
        self._since = [math.inf] * MOTOR_PORTS
        self._last_motion = [0.0] * MOTOR_PORTS
        self._time = 0.0

    def update(self, duties: Sequence[float], bemf: Sequence[float], time: float) -> bool:
        """True where any motor is at fault. duties: what drove the motors until now."""
        wrong = False
        dt, self._time = time - self._time, time
        if dt > self.PAUSE:  # what is read now may be a mean over it
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
            # Nothing is expected yet of one that was driven the other way: that it reads so is no motion.
            self._turned[port] = self._turned[port] or bemf * sign >= self.DRIVEN * per_duty
            self._since[port] = time
            return False
        patience = self.SECONDS_FROM_MOTION if self._turned[port] else self.SECONDS_FROM_REST
        return time - self._since[port] > patience


class RestWatch:
    """Motors without a command that nevertheless report motion: an offset of the back-EMF conversion.

    It turns into phantom distance. Coasting down takes a while and changes the reading; an offset does not.
    known: counts of each motor that are calibrated, and so turn into none.
    """

    SETTLE = 0.3
    """Seconds without a command and without a change."""
    STEADY = 15.0
    """Counts around the smoothed reading."""
    SMOOTHING = 0.05
    LARGEST = 12.0
    """Counts beyond the known ones, smoothed."""

    def __init__(self, known: Sequence[float] = (0.0,) * MOTOR_PORTS) -> None:
        self._since: float | None = -math.inf  # before its first command it stands
        self._known = tuple(known)
        self._smooth = list(known)
        self.offset = list(known)

    def update(self, duties: Sequence[float], bemf: Sequence[float], time: float) -> bool:
        """True where a motor at rest reports motion. `offset` keeps the latest readings at rest."""
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
        # A dead zone may hide a known one.
        return abs(offset) > self.LARGEST and abs(offset - known) > self.LARGEST

    def is_resting(self, time: float) -> bool:
        """Whether the motors have stood for a while."""
        return self._since is not None and time - self._since > self.SETTLE


class BatteryWatch:
    """A battery so low that the controller may restart; smoothed, for a start of the motors pulls it down."""

    LOWEST = 5.7
    RECOVERED = 5.9
    TIME_CONSTANT = 0.2

    def __init__(self) -> None:
        self._time: float | None = None
        self._low = False
        self.voltage = 0.0

    def update(self, voltage: float, time: float) -> bool:
        """True while the smoothed voltage is too low."""
        if self._time is None:
            self.voltage = voltage
        else:
            share = min((time - self._time) / self.TIME_CONSTANT, 1.0)
            self.voltage += share * (voltage - self.voltage)
        self._time = time
        self._low = self.voltage < (self.RECOVERED if self._low else self.LOWEST)
        return self._low
