"""Comparison of a motor with the model that its controller was tuned for: stall, unplugged, weak magnet, high
resistance."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from raccoon.control.feedforward import WheelModel
from raccoon.control.voltage_fit import WINDOW_S, RecursiveFit, Vector3, Windows

STALL_SPEED_SHARE = 0.2
"""Speed below which a wheel may be stalled, as a share of a nominal wheel's at this voltage; the slowest of
the paper's motors is far above."""
STALL_TIME_S = 0.35
"""s below that speed after which a wheel is stalled: longer than breaking loose takes at the lowest voltage
that does it."""
STALL_OVERDRIVE = 0.8
"""V beyond the voltage of friction above which a stall is possible."""
HELD_TIME_S = 0.06
"""s without motion after which the wheel is held; one that starts under full voltage has a reading by
then."""
LOOSE_TIME_S = 0.1
"""s after its release in which the reading follows the filter and not the motor."""
ODD_SHARE = 0.25
"""Relative difference of a motor from its model, or of its load from the other's, above which it is
reported."""
ODD_LOADS = (0.5, 2.0)
"""Bounds on the load factor of both motors together, beyond which it is reported."""
READING_JITTER_S = 0.005
"""s, standard deviation of a reading's time: it makes the acceleration's voltage uncertain."""
READING_DELAY_S = 0.012
"""s by which the readings of both wheels are late: 5 ms by the smoothing of the speeds, the rest by the
firmwares' samples. The delay looks like load."""
CLEAR_ACCELERATION_RATIO = 3.0
"""Least acceleration in a fit, over its noise. Below it noise would be compared with the voltage that
responds to it, and load would seem to need no voltage."""
HELD_BACK_WINDOWS = 5
"""Number of windows held back from the fit: a wall shows in both wheels' load only after a quarter of a
second."""
MAX_RAMP_V = 1.0
"""V, largest change of the voltage in a window of an accelerating motion."""
BATTERY_LAG_S = 0.1
"""s by which the battery reading is late: meanwhile a motor gets another voltage than intended."""
ROW_NOISE, READ_NOISE = 0.06, 0.015
"""V, standard deviation of a window's voltage for any motor; and V of back-EMF, standard deviation of the
speeds at its ends: for a geared-up motor, whose speed takes few volts and whose acceleration many, that is
most of it."""
MIN_ROWS = 12
"""Least number of windows for a result."""


@dataclass(frozen=True, slots=True)
class WheelState:
    """Result of the watch on one wheel.

    known: enough was seen. speed_factor, load_factor: present over nominal V per rad/s (K_E) and V per N m (R
    / K_E), with their standard deviations. load_late: what late readings may have added to load_factor.
    """

    known: bool
    speed_factor: float
    speed_factor_std: float
    load_factor: float
    load_factor_std: float
    load_late: float = 0.0

    @property
    def odd_speed(self) -> str:
        """What is odd about the voltage of a speed; "" if nothing is."""
        off = abs(self.speed_factor - 1.0)
        if not self.known or off <= max(ODD_SHARE, 4.0 * self.speed_factor_std):
            return ""
        if self.speed_factor <= 0.0:
            return (
                "turns against its voltage: wrong sign (inverted), commands that act so late that it "
                "oscillates, or something drives it"
            )
        return f"needs {self.speed_factor:.2f} times the voltage for its speed: magnet (K_E) or calibration"


def describe_oddities(left: WheelState, right: WheelState) -> tuple[str, str]:
    """What is odd about the left and the right wheel; "" if nothing is.

    Loads are compared with each other: a reading that is d s late adds d V/(rad/s) to the apparent voltage of
    an acceleration (a sixth of it for 5 ms, all of it if a wheel's time constant is as short), on both sides
    alike.
    """
    if left.odd_speed or right.odd_speed or not (left.known and right.known):
        return left.odd_speed, right.odd_speed
    if min(left.load_factor, right.load_factor) <= 0.0:
        return "", ""
    ratio = left.load_factor / right.load_factor
    std = math.hypot(left.load_factor_std / left.load_factor, right.load_factor_std / right.load_factor)
    if max(ratio, 1.0 / ratio) - 1.0 > max(ODD_SHARE, 3.0 * std * max(ratio, 1.0 / ratio)):
        words = "needs {:.2f} times the voltage of the other wheel under load: resistance, magnet, friction"
        return (words.format(ratio), "") if ratio > 1.0 else ("", words.format(1.0 / ratio))
    both = 0.5 * (left.load_factor + right.load_factor)
    # A drive at constant speed holds almost no information on inertia.
    std = 0.5 * math.hypot(left.load_factor_std, right.load_factor_std)
    late = 0.5 * (left.load_late + right.load_late)
    if both + 3.0 * std < ODD_LOADS[0] or both - 3.0 * std - late > ODD_LOADS[1]:
        words = f"needs, like the other, {both:.1f} times the voltage for its load: weight, inertia_straight"
        return words, words
    return "", ""


class WheelWatch:
    """Watches one wheel. Call `update` in every cycle in which the motor is driven.

    Half of K_E shows as half of the V per rad/s if the speed is measured independently. As the counter of
    such a motor is wrong by the same factor, it shows as twice the voltage of friction and inertia instead.
    Resistance that is higher by half shows as both being higher by half.
    """

    __slots__ = (
        "_fit",
        "_found",
        "_has_sagged",
        "_high_windows",
        "_least_change",
        "_least_slope",
        "_loose_seconds",
        "_low_windows",
        "_model",
        "_silent_seconds",
        "_static",
        "_windows",
        "held",
        "stalled",
        "stands",
    )

    def __init__(self, model: WheelModel) -> None:
        self._model = model
        self._static = model.static_voltage
        self._least_slope = STALL_SPEED_SHARE * model.gain
        self._windows = Windows()
        nominal = (model.static_voltage, 1.0 / model.gain, model.acceleration_voltage)
        # Friction may be wrong by all of itself, the V per rad/s is calibrated, the inertia is a guess.
        spread = (0.8 * nominal[0] + 0.1, 0.3 * nominal[1], 0.8 * nominal[2])
        scatter = (
            math.sqrt(2.0) * READ_NOISE / model.back_emf_constant / WINDOW_S
        )  # rad/s2, from the speeds at a window's ends
        self._least_change = CLEAR_ACCELERATION_RATIO * scatter
        noise = math.hypot(ROW_NOISE, scatter * nominal[2])
        self._fit = RecursiveFit(nominal, spread, noise=noise, memory=120.0)
        self._found: deque[tuple[Vector3, float, float]] = deque(maxlen=HELD_BACK_WINDOWS)
        self._low_windows = self._high_windows = 0.0
        self._silent_seconds = self._loose_seconds = self._has_sagged = 0.0
        self.stalled = False
        self.held = False
        """Whether the wheel's load is known to differ from that of driving straight: nothing is learnt
        then."""
        self.stands = False
        """Whether its target is (almost) 0: corrections may then not turn it, which is no stall."""

    def update(self, voltage: float, speed: float | None, dt: float, sagged: float = 0.0) -> None:
        """Take a cycle of dt s with `voltage` V; `speed` rad/s at its end, None without a reading.

        sagged: relative change of the battery voltage in this cycle. A driven wheel without a reading, or
        with one against its voltage, counts as stalled after the same time as one that stands: with a frozen
        reading it would be driven further and further.
        """
        self._has_sagged += sagged * voltage
        if speed is None:
            self._windows.clear()
            self._silent_seconds += dt
            self.stalled = self._silent_seconds > STALL_TIME_S
            return
        spare = abs(voltage) - self._static
        moves = math.copysign(speed, speed * voltage) >= self._least_slope * spare
        turns = moves or self.stands or spare <= STALL_OVERDRIVE
        self._silent_seconds = 0.0 if turns else self._silent_seconds + dt
        self.stalled = self._silent_seconds > STALL_TIME_S
        self._loose_seconds = max(0.0, self._loose_seconds - dt)
        if self._silent_seconds > HELD_TIME_S or self.held:
            if self._loose_seconds == 0.0 and self._found:
                self._found.pop()
            self._loose_seconds = LOOSE_TIME_S
        if self._loose_seconds > 0.0:
            self._windows.clear()
            self._has_sagged = 0.0
        else:
            self._learn(voltage, speed, dt)

    def _learn(self, voltage: float, speed: float, dt: float) -> None:
        """Process a full window, and learn from the one `HELD_BACK_WINDOWS` before it. Before a standstill,
        and before a push is detected, a wheel was braked by more than its motor, so those windows are
        dropped."""
        self._low_windows, self._high_windows = (
            min(self._low_windows, voltage),
            max(self._high_windows, voltage),
        )
        found = self._windows.add(voltage, speed, dt)
        if found is not None:
            if len(self._found) == self._found.maxlen:
                self._fit.add(*self._found.popleft())
            row, volts = found
            if abs(row[2]) < self._least_change:
                row = (row[0], row[1], 0.0)
            # A reading is of a moment earlier, with another mean voltage if that swings.
            swung = (
                READING_JITTER_S * max(0.0, self._high_windows - self._low_windows - MAX_RAMP_V) / WINDOW_S
            )
            sagged = BATTERY_LAG_S / WINDOW_S * self._has_sagged
            self._found.append(
                (row, volts, math.hypot(READING_JITTER_S * row[2] / self._model.gain, swung, sagged))
            )
            self._low_windows = self._high_windows = voltage
            self._has_sagged = 0.0

    def drop_recent(self) -> None:
        """Drop the last windows: the robot turns out to push against something."""
        self._found.clear()

    def stop_learning(self) -> None:
        """The motor is off: learn from the last windows, and stop."""
        while self._found:
            self._fit.add(*self._found.popleft())
        self._windows.clear()
        self._silent_seconds = 0.0
        self.stalled = self.stands = False

    @property
    def state(self) -> WheelState:
        """The present verdict."""
        fit, model = self._fit, self._model
        speed, speed_std = fit.values[1] * model.gain, fit.std(1) * model.gain
        load = fit.values[2] / model.acceleration_voltage
        load_std = fit.std(2) / model.acceleration_voltage
        late = READING_DELAY_S / (model.gain * model.acceleration_voltage)
        return WheelState(fit.rows >= MIN_ROWS, speed, speed_std, load, load_std, late)
