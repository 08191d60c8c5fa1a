"""Models of a wheel's response, simple enough to be tried at every delay of a reading.

The simplest follows its command by a low-pass, with dry friction proportional to the sign of its speed. The
family of models that is tried if it does not fit adds what it lacks: friction that stops the wheel, a motor
that coasts at duty 0, and the filter of a reading.
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
"""Time constants of a wheel together with its reading's filter, s."""
WHEEL_TIME_CONSTANTS_S = (0.02, 0.035, 0.06, 0.1, 0.17, 0.3)
"""Time constants of a wheel alone, s."""
WHEEL_FRICTIONS = (0.0, 0.05, 0.1, 0.2)
"""Friction of a wheel, in duty."""
READING_FILTERS_S = (0.0225, 0.045)
"""Time constants of a reading's filter, s, beside no filter."""
DELAY_STEP_S, MAX_DELAY_S = 0.02, 0.3
"""Step of the delays that are tried, and the longest one in either direction, s."""
MIN_CHANGED_ROWS = 10
"""Least number of rows in which a command must differ from its median to count as varied."""
MIN_READINGS, MAX_READINGS = 200, 3000
"""Least number of readings for an estimate of the response, and the most that are used."""
MAX_ERROR_RATIO = 0.8
"""Largest ratio of the error at an early delay to the least error at other delays, for a response that is
clearly early."""
MAX_FOLLOWED_UNEXPLAINED = 0.3
"""Largest unexplained share of a reading's power if the commands explain it at all."""


@dataclass(frozen=True, slots=True)
class Response:
    """Response of a reading to its commands. unexplained: share of its power that commands leave at the best
    delay. unexplained_in_time: the same at the best delay that is not early. delay: the best one, s, negative
    if the reading comes first. latest_early: delay below which a response is early, s."""

    unexplained: float
    unexplained_in_time: float
    delay: float
    latest_early: float

    @property
    def is_early(self) -> bool:
        """Whether the response clearly comes before its command."""
        better = self.unexplained < MAX_ERROR_RATIO * self.unexplained_in_time
        follows = self.unexplained < MAX_FOLLOWED_UNEXPLAINED
        return self.delay < self.latest_early - 1e-9 and better and follows

    @property
    def explained_percent(self) -> str:
        """The explained share as a text in percent."""
        return f"{100.0 * max(1.0 - self.unexplained, 0.0):.0f} %"


@dataclass(frozen=True, slots=True)
class WheelFamily:
    """Several wheel models, each array (wheels,). time_constant: s. friction: in duty. coasts: at duty 0."""

    time_constant: Array
    friction: Array
    coasts: NDArray[np.bool_]

    @classmethod
    def usual(cls) -> WheelFamily:
        """All combinations of the constants above. A coasting wheel is stopped by friction alone, so it has
        some."""
        every = product(WHEEL_TIME_CONSTANTS_S, WHEEL_FRICTIONS, (False, True))
        members = [each for each in every if each[1] > 0.0 or not each[2]]
        time_constant, friction, coasts = zip(*members, strict=True)
        return cls(np.array(time_constant), np.array(friction), np.array(coasts))

    def speeds(self, duty: Array, step: float) -> Array:
        """Speeds of the wheels in units of duty for commands (rows,) with rows `step` s apart: (rows, wheels)
        without a filter, followed by as many columns behind each of `READING_FILTERS_S`."""
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
    """Mean square of a reading that a wheel's speed with dry friction and an offset does not explain."""
    columns = np.stack([speed, np.sign(speed), np.ones_like(speed)])
    # For so few columns the normal equations are accurate and take a tenth of the time. They are singular if
    # two columns are equal, hence lstsq.
    found = np.linalg.lstsq(columns @ columns.T, columns @ reading, rcond=None)[0]
    return float(np.mean((reading - found @ columns) ** 2))


def least_residual_power(speed: Array, reading: Array) -> float:
    """Least mean square of a reading that one of many wheels, speed (rows, wheels), with a scale and an
    offset, does not explain."""
    off, centred = reading - reading.mean(), speed - speed.mean(axis=0)
    power = np.maximum((centred**2).sum(axis=0), 1e-300)
    return float(off @ off - ((off @ centred) ** 2 / power).max()) / len(reading)


@dataclass(frozen=True, slots=True)
class DelayScan:
    """Samples of a reading for the comparison of delays. rows: of the samples, far enough from both ends for
    any delay. reading (rows,). step: duration of a row, s."""

    rows: NDArray[np.intp]
    reading: Array
    step: float

    @classmethod
    def of(cls, time: Array, channel: Channel) -> DelayScan | None:
        """The samples of a channel; None if it has too few readings."""
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
        """The response at the best delay. power_left: for the rows of the signal, which are a delay earlier
        than the reading's, the mean square of the reading that the signal does not explain. latest_early: s,
        see `Response`."""
        steps = round(MAX_DELAY_S / DELAY_STEP_S)
        delays = DELAY_STEP_S * np.arange(-steps, steps + 1)
        power = max(float(np.var(self.reading)), 1e-300)
        left = np.array([power_left(self.rows - round(each / self.step)) / power for each in delays])
        best = int(np.argmin(left))
        in_time = float(left[delays >= latest_early - 1e-9].min())
        return Response(float(left[best]), in_time, float(delays[best]), latest_early)

    def response_of_simple_wheel(self, duty: Array, latest_early: float = 0.0) -> Response:
        """The response to a command by the simplest wheel model."""
        simple = [low_pass(duty, self.step, each) for each in SIMPLE_TIME_CONSTANTS_S]

        def power_left(rows: NDArray[np.intp]) -> float:
            return min(residual_power(each[rows], self.reading) for each in simple)

        return self.response(power_left, latest_early)

    def response_of_wheel_family(self, duties: Sequence[Array], latest_early: float) -> Response:
        """The response to commands by the best wheel model of the family. For a gyro there are several
        commands, whose wheel speeds add up."""
        family = WheelFamily.usual()
        speeds = np.sum([family.speeds(each, self.step) for each in duties], axis=0)
        return self.response(lambda rows: least_residual_power(speeds[rows], self.reading), latest_early)


def is_varied(command: Array) -> bool:
    """Whether a command varies in enough rows: a stop in the last row alone has no response."""
    return int(np.count_nonzero(command != np.median(command))) >= MIN_CHANGED_ROWS


def estimate_response(
    time: Array, duties: Sequence[Array], channel: Channel, latest_early: float, max_unexplained: float
) -> Response | None:
    """The response of a reading to its commands, whose effects add up; None without enough of either.

    latest_early: delay below which a response is early, s. max_unexplained: unexplained share of the
    reading's power above which it does not respond at all. Both conclusions are only drawn from the best of
    many wheel models.
    """
    scan, duty = DelayScan.of(time, channel), np.sum(duties, axis=0)
    if scan is None or not is_varied(duty):
        return None
    simple = scan.response_of_simple_wheel(duty, latest_early)
    if not (simple.is_early or simple.unexplained > max_unexplained):
        return simple
    best = scan.response_of_wheel_family(duties, latest_early)
    # The simplest model may still explain most, since its friction is a free column; then it is not early.
    return best if best.is_early or best.unexplained <= simple.unexplained else replace(simple, delay=0.0)
