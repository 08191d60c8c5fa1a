"""A slew limit between the commands of a program and what its motors get."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.bins import low_pass
from raccoon.diagnose.drives.log import Channel
from raccoon.diagnose.drives.response_models import (
    DELAY_STEP_S,
    MAX_DELAY_S,
    MAX_READINGS,
    MIN_READINGS,
    SIMPLE_TIME_CONSTANTS_S,
    residual_power,
)
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]

TRIED_RAMPS = (2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 8.0, 12.0)
"""Slew rates that are tried, duty per second."""
MAX_RAMP_ERROR_RATIO, MIN_UNEXPLAINED = 0.1, 0.005
"""Largest ratio of the error with a slew limit to that without one, and least unexplained share of a
reading's power without one. The ratio was 0.01 to 0.03 for drives behind a slew limit. A motor with limited
current also speeds up along a ramp, but brakes along a steeper one, since friction helps then: for a motor
with a fifth of its stall current on a heavy robot, a slew limit of 5 left a ratio of 0.2."""


@dataclass(frozen=True, slots=True)
class Ramp:
    """A slew limit. rate: largest rate of the motors' duty, 1/s. soft: whether it only limits increases of
    the magnitude, as a soft-starting driver does; decreases act at once."""

    rate: float
    soft: bool = False

    def given(self, time: Array, duty: Array) -> Array:
        """The duty that the motors get, (n, wheels), for commands (n, wheels) at `time` (s)."""
        most = (self.rate * np.diff(time, prepend=time[0])).tolist()
        return np.stack([self._followed(each.tolist(), most) for each in duty.T], axis=1)

    def _followed(self, duty: list[float], most: list[float]) -> Array:
        now, found = duty[0], []
        for asked, by in zip(duty, most, strict=True):
            less = more = now
            if self.soft:
                same = now if now * asked > 0.0 else 0.0
                less, more = min(same, 0.0), max(same, 0.0)
            now = min(max(asked, less - by), more + by)
            found.append(now)
        return np.array(found)


def estimate_ramp(time: Array, duty: Array, channel: Channel) -> float | None:
    """The slew rate, duty per second, with which a wheel follows its command far better; None if there is
    none."""
    step = median_step(time)
    reach = round(MAX_DELAY_S / step)
    # A wheel that coasts to rest, or breaks loose from rest, also lags its command: such rows are left out.
    since = np.arange(len(duty)) - np.maximum.accumulate(np.where(duty == 0.0, np.arange(len(duty)), 0))
    known = np.flatnonzero(np.isfinite(channel.values) & (since > reach))
    if len(known) < MIN_READINGS or float(np.ptp(duty[known])) == 0.0:
        return None
    known = known[:: -(-len(known) // MAX_READINGS)]
    reading = channel.values[known]

    def least_power(commands: Array) -> float:
        speeds = (low_pass(commands, step, each) for each in SIMPLE_TIME_CONSTANTS_S[:3])
        rows = [known - round(delay / step) for delay in DELAY_STEP_S * np.arange(6)]
        return min(residual_power(each[row], reading) for each in speeds for row in rows)

    plain = least_power(duty)
    if plain <= MIN_UNEXPLAINED * float(np.var(reading)):
        return None
    ramped = {rate: least_power(_slew_limited(duty, rate * step)) for rate in TRIED_RAMPS}
    best = min(ramped, key=lambda rate: ramped[rate])
    return best if ramped[best] < MAX_RAMP_ERROR_RATIO * plain else None


def _slew_limited(duty: Array, most: float) -> Array:
    """The command with its change per row limited to `most`."""
    now, found = float(duty[0]), []
    for each in duty.tolist():
        change = each - now
        now = now + most if change > most else now - most if change < -most else each
        found.append(now)
    return np.array(found)
