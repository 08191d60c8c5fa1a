"""Models of a wheel's response that are simple enough to be tried at every delay of a reading.

The simplest follows its command by a low-pass, and has a dry friction as large as its sign. Those that are
asked when it does not answer its command have what it lacks: a friction that stops them, a motor that coasts
where nothing is commanded, and the filter of a reading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.bins import low_pass
from raccoon.diagnose.drives.log import Channel
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]

SIMPLE_TIME_CONSTANTS_S = (0.03, 0.06, 0.12, 0.25)
"""s, time constants of a wheel together with its reading's filter."""
WHEEL_TIME_CONSTANTS_S = (0.02, 0.035, 0.06, 0.1, 0.17, 0.3)
"""s, time constants of a wheel alone."""
WHEEL_FRICTIONS = (0.0, 0.05, 0.1, 0.2)
"""Duty that friction takes away."""
READING_FILTERS_S = (0.0225, 0.045)
"""s of a reading's filter, where it has one."""
DELAY_STEP_S, MAX_DELAY_S = 0.02, 0.3
"""s by which delays are tried, and the longest of them, either way."""
MIN_CHANGED_ROWS = 10
"""Rows in which a command is another than mostly, from which it changes."""
MIN_READINGS, MAX_READINGS = 200, 3000
"""Readings from which a response is estimated, and of how many at most."""
MAX_ERROR_RATIO = 0.8
"""Part of the error without a delay that is left where an answer is surely early."""
MAX_FOLLOWED_UNEXPLAINED = 0.3
"""Part of a reading's power up to which commands explain it at all."""


@dataclass(frozen=True, slots=True)
class Response:
    """How a reading answers its commands. unexplained: part of its power that commands leave at the best
    delay (s). unexplained_in_time: the same at delays that are not early. latest_early: s, the delay below
    which an answer is early."""

    unexplained: float
    unexplained_in_time: float
    delay: float
    latest_early: float

    @property
    def is_early(self) -> bool:
        """Whether it surely comes before its command."""
        better = self.unexplained < MAX_ERROR_RATIO * self.unexplained_in_time
        follows = self.unexplained < MAX_FOLLOWED_UNEXPLAINED
        return self.delay < self.latest_early - 1e-9 and better and follows

    @property
    def explained_percent(self) -> str:
        """What commands explain of it, in words."""
        return f"{100.0 * max(1.0 - self.unexplained, 0.0):.0f} %"


@dataclass(frozen=True, slots=True)
class WheelFamily:
    """Wheels side by side, (wheels,): their time constants (s), frictions (duty), and whether each coasts at
    duty 0."""

    time_constant: Array
    friction: Array
    coasts: NDArray[np.bool_]

    @classmethod
    def usual(cls) -> WheelFamily:
        """All combinations; a wheel that coasts is stopped by friction alone, so it has some."""
        every = product(WHEEL_TIME_CONSTANTS_S, WHEEL_FRICTIONS, (False, True))
        members = [each for each in every if each[1] > 0.0 or not each[2]]
        time_constant, friction, coasts = zip(*members, strict=True)
        return cls(np.array(time_constant), np.array(friction), np.array(coasts))

    def speeds(self, duty: Array, step: float) -> Array:
        """Their speeds, in duty, (rows, wheels), under a command (rows,) with rows of that step, s; then the
        same behind each of `READING_FILTERS_S`, beside them."""
        gain = 1.0 - np.exp(-step / self.time_constant)
        drag, undriven = gain * self.friction, np.where(self.coasts, 0.0, gain)
        kept = [1.0 - np.exp(-step / each) for each in READING_FILTERS_S]
        count = len(gain)
        speed, found = np.zeros(count), np.zeros((len(duty), (1 + len(READING_FILTERS_S)) * count))
        read = [np.zeros(count) for _ in READING_FILTERS_S]
        for row, each in enumerate(duty.tolist()):
            speed += (gain if each else undriven) * (each - speed)
            speed = np.copysign(np.maximum(np.abs(speed) - drag, 0.0), speed)
            found[row, :count] = speed
            for place, (reading, part) in enumerate(zip(read, kept, strict=True), 1):
                reading += part * (speed - reading)
                found[row, place * count : (place + 1) * count] = reading
        return found


def residual_power(speed: Array, reading: Array) -> float:
    """Mean square of a reading beyond what a wheel's speed explains, with a dry friction and an offset."""
    columns = np.stack([speed, np.sign(speed), np.ones_like(speed)])
    # Of so few columns their products do, in a tenth of the time; of two that are alike they have no inverse.
    found = np.linalg.lstsq(columns @ columns.T, columns @ reading, rcond=None)[0]
    return float(np.mean((reading - found @ columns) ** 2))


def least_residual_power(speed: Array, reading: Array) -> float:
    """The least of many wheels, speed (rows, wheels), each with a scale and an offset alone."""
    off, centred = reading - reading.mean(), speed - speed.mean(axis=0)
    power = np.maximum((centred**2).sum(axis=0), 1e-300)
    return float(off @ off - ((off @ centred) ** 2 / power).max()) / len(reading)


@dataclass(frozen=True, slots=True)
class DelayScan:
    """The samples of a reading by which delays are compared. rows: of them, far enough from both ends.
    reading: (rows,). step: s of a row."""

    rows: NDArray[np.intp]
    reading: Array
    step: float

    @classmethod
    def of(cls, time: Array, channel: Channel) -> DelayScan | None:
        """That of a channel; None where too little of it is known."""
        known = np.flatnonzero(np.isfinite(channel.values))
        step = median_step(time)
        reach = round(MAX_DELAY_S / step)
        known = known[(known >= reach) & (known < len(time) - reach)]
        if len(known) < MIN_READINGS:
            return None
        known = known[:: -(-len(known) // MAX_READINGS)]
        return cls(known, channel.values[known], step)

    def response(
        self, power_left: Callable[[NDArray[np.intp]], float], latest_early: float = 0.0
    ) -> Response:
        """The response at the best delay. power_left: mean square of the reading beyond what the signal at
        these rows explains, which are earlier than its own by a delay. latest_early: s, see `Response`."""
        steps = round(MAX_DELAY_S / DELAY_STEP_S)
        delays = DELAY_STEP_S * np.arange(-steps, steps + 1)
        power = max(float(np.var(self.reading)), 1e-300)
        left = np.array([power_left(self.rows - round(each / self.step)) / power for each in delays])
        best = int(np.argmin(left))
        in_time = float(left[delays >= latest_early - 1e-9].min())
        return Response(float(left[best]), in_time, float(delays[best]), latest_early)

    def response_of_simple_wheel(self, duty: Array, latest_early: float = 0.0) -> Response:
        """The response to a command as the simplest wheel explains it."""
        simple = [low_pass(duty, self.step, each) for each in SIMPLE_TIME_CONSTANTS_S]

        def power_left(rows: NDArray[np.intp]) -> float:
            return min(residual_power(each[rows], self.reading) for each in simple)

        return self.response(power_left, latest_early)

    def response_of_wheel_family(self, duties: Sequence[Array], latest_early: float) -> Response:
        """The response to commands as the best of many wheels explains it; of a gyro several commands, as the
        wheels' speeds add up in it."""
        family = WheelFamily.usual()
        speeds = np.sum([family.speeds(each, self.step) for each in duties], axis=0)
        return self.response(lambda rows: least_residual_power(speeds[rows], self.reading), latest_early)


def is_varied(command: Array) -> bool:
    """Whether a command is not nearly all the time the same: a stop in the last row is answered in none."""
    return int(np.count_nonzero(command != np.median(command))) >= MIN_CHANGED_ROWS


def estimate_response(
    time: Array, duties: Sequence[Array], channel: Channel, latest_early: float, max_unexplained: float
) -> Response | None:
    """How a reading answers its commands, whose answers add up; None where there is too little of either.

    latest_early: s, the delay below which an answer is early. max_unexplained: part of the reading's power
    beyond which it does not answer at all. Either is concluded from the best of many wheels only.
    """
    scan, duty = DelayScan.of(time, channel), np.sum(duties, axis=0)
    if scan is None or not is_varied(duty):
        return None
    simple = scan.response_of_simple_wheel(duty, latest_early)
    if not (simple.is_early or simple.unexplained > max_unexplained):
        return simple
    best = scan.response_of_wheel_family(duties, latest_early)
    # The simplest may still explain most, by the friction that is a column of its own; it is not early then.
    return best if best.is_early or best.unexplained <= simple.unexplained else replace(simple, delay=0.0)
