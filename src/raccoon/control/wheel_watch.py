"""Is a motor still the one the controller was tuned for? Stall, unplugged, weak magnet, high resistance."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from raccoon.control.feedforward import WheelModel
from raccoon.control.voltage_fit import WINDOW_S, RecursiveFit, Vector3, Windows

STALL_SPEED_SHARE = 0.2
"""Of the speed this voltage gives a nominal wheel; the slowest of the paper's motors reaches far more."""
STALL_TIME_S = 0.35
"""s of it: longer than breaking loose takes at the least voltage that does it."""
STALL_OVERDRIVE = 0.8
"""V beyond what friction takes before silence means anything."""
HELD_TIME_S = 0.06
"""s of silence after which something holds the wheel; one that starts under full voltage reads by then."""
LOOSE_TIME_S = 0.1
"""s after it was let go in which the reading jumps by the filter's law and not by the motor's."""
ODD_SHARE = 0.25
"""A motor that takes this much more or less than its model, or under load than the other, is reported."""
ODD_LOADS = (0.5, 2.0)
"""Load factors beyond which both motors together are."""
READING_JITTER_S = 0.005
"""s by which a reading may be later or earlier than the others: what a jerk tells is that much in doubt."""
READING_DELAY_S = 0.012
"""s by which the readings of both wheels come late: 5 ms by the smoothing of the speeds, the rest by what
firmwares do with their samples. It looks like load."""
CLEAR_ACCELERATION_RATIO = 3.0
"""Times its noise from which on an acceleration is one. Of less, noise would be compared with the voltage
that answers it, and would say that a load takes none."""
HELD_BACK_WINDOWS = 5
"""Windows that are kept back: it takes a quarter of a second until a wall shows in what both wheels carry."""
MAX_RAMP_V = 1.0
"""V by which the voltage of a motion that speeds up changes in a window, at the most."""
BATTERY_LAG_S = 0.1
"""s by which the battery's voltage is known late: a motor gets other volts meanwhile than it was meant to."""
ROW_NOISE, READ_NOISE = 0.06, 0.015
"""V by which a window's voltage is off, whatever the motor; V of back-EMF by which its speeds at either end
are: of a motor geared up, whose speed takes few volts and whose acceleration many, that is most of it."""
MIN_ROWS = 12
"""Windows before anything is said."""


@dataclass(frozen=True, slots=True)
class WheelState:
    """What the watch thinks of one wheel.

    known: enough was seen for the rest. speed_factor, load_factor: present over nominal V a rad/s (K_E) and
    V a N m (R / K_E), with their standard deviations. load_late: what late readings may have added to it.
    """

    known: bool
    speed_factor: float
    speed_factor_std: float
    load_factor: float
    load_factor_std: float
    load_late: float = 0.0

    @property
    def odd_speed(self) -> str:
        """What is odd about the voltage that a speed takes, "" where nothing is."""
        off = abs(self.speed_factor - 1.0)
        if not self.known or off <= max(ODD_SHARE, 4.0 * self.speed_factor_std):
            return ""
        if self.speed_factor <= 0.0:
            return (
                "turns against its voltage: the sign of its reading (inverted), commands that act so late "
                "that it rings, or something drives it"
            )
        return f"takes {self.speed_factor:.2f} times the voltage a speed should: magnet (K_E) or calibration"


def describe_oddities(left: WheelState, right: WheelState) -> tuple[str, str]:
    """What is odd about the left and about the right wheel, "" where nothing is.

    Loads are compared with each other: a reading that comes d s late adds d V/(rad/s) to the voltage that an
    acceleration seems to take (a sixth of it for 5 ms, all of it where a wheel's time constant is as short),
    and it does so on both sides.
    """
    if left.odd_speed or right.odd_speed or not (left.known and right.known):
        return left.odd_speed, right.odd_speed
    if min(left.load_factor, right.load_factor) <= 0.0:
        return "", ""
    ratio = left.load_factor / right.load_factor
    std = math.hypot(left.load_factor_std / left.load_factor, right.load_factor_std / right.load_factor)
    if max(ratio, 1.0 / ratio) - 1.0 > max(ODD_SHARE, 3.0 * std * max(ratio, 1.0 / ratio)):
        words = "takes {:.2f} times the voltage that the other takes under load: resistance, magnet, friction"
        return (words.format(ratio), "") if ratio > 1.0 else ("", words.format(1.0 / ratio))
    both = 0.5 * (left.load_factor + right.load_factor)
    # Who drives at one speed says next to nothing of inertia.
    std = 0.5 * math.hypot(left.load_factor_std, right.load_factor_std)
    late = 0.5 * (left.load_late + right.load_late)
    if both + 3.0 * std < ODD_LOADS[0] or both - 3.0 * std - late > ODD_LOADS[1]:
        words = f"takes, like the other, {both:.1f} times the voltage a load should: weight, inertia_straight"
        return words, words
    return "", ""


class WheelWatch:
    """Watches one wheel. Feed it every cycle in which the motor is driven.

    Half the K_E shows as half the V a rad/s where the speed is known otherwise; as the counter of such a
    motor lies by the same factor, it shows as twice the friction and inertia voltage instead. Half as much
    resistance again shows as half as much more of both.
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
        # Friction may differ by all of itself, the V a rad/s is calibrated, the inertia is a guess.
        spread = (0.8 * nominal[0] + 0.1, 0.3 * nominal[1], 0.8 * nominal[2])
        scatter = (
            math.sqrt(2.0) * READ_NOISE / model.back_emf_constant / WINDOW_S
        )  # rad/s2, of a window's ends
        self._least_change = CLEAR_ACCELERATION_RATIO * scatter
        noise = math.hypot(ROW_NOISE, scatter * nominal[2])
        self._fit = RecursiveFit(nominal, spread, noise=noise, memory=120.0)
        self._found: deque[tuple[Vector3, float, float]] = deque(maxlen=HELD_BACK_WINDOWS)
        self._low_windows = self._high_windows = 0.0
        self._silent_seconds = self._loose_seconds = self._has_sagged = 0.0
        self.stalled = False
        self.held = False
        """Whether somebody knows that the wheel carries more or less than when it drives straight on: nothing
        is learnt then."""
        self.stands = False
        """Whether it is asked to stand, or nearly: what corrects it may turn nothing and be no stall."""

    def update(self, voltage: float, speed: float | None, dt: float, sagged: float = 0.0) -> None:
        """A cycle of dt s under `voltage` V; `speed` rad/s at its end, None where there is no reading.

        sagged: by which share the battery's voltage fell or rose in this cycle. A driven wheel that does not
        say that it turns, or says that it turns against its voltage, counts as stalled after as long as one
        that stands: a reading that is frozen would have it driven further and further.
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
        """Take each window when so many more are full: in the last one before it was silent, and in the last
        ones before it is known that it pushes, a wheel was braked by more than its motor."""
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
            # What is read is of a moment earlier: of another mean voltage, where that swings.
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
        """It turns out to push against something: what was seen last is not learnt."""
        self._found.clear()

    def stop_learning(self) -> None:
        """The motor is off: nothing more is learnt."""
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
