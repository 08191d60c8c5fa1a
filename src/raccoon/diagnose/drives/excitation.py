"""Excitation of a drive by its commands: whether the robot moves at all, and whether the commands
oscillate."""

from __future__ import annotations

import numpy as np

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.response_models import is_varied
from raccoon.trace.recording import median_step

MIN_SWING_HZ, MAX_SWING_HZ = 4.0, 15.0
"""Range of the oscillation's frequency, Hz. In slower ones the wheels' readings, 30 ms late, show the
disturbances that the commands respond to, as in any drive."""
SWING_BAND_FACTOR = 1.25
"""Half-width of an oscillation's frequency band, as a factor: from frequency / factor to frequency *
factor."""
MIN_SWING_POWER_SHARE = 0.4
"""Least share of the commands' power in the band of an oscillation: 0.6 to 0.8 for robots under bang-bang
control, at most 0.18 in 250 other drives."""
CLOCK_LINES, MAX_CLOCK_SHARE = 6, 0.75
"""If this number of spectral lines holds more than this share of the band's power, a clock made the
oscillation: a program that wiggles on purpose, which is good excitation."""


def is_driven(log: Log) -> bool:
    """Whether the commands change and the wheels respond; without both, nothing can be identified."""
    commanded = any(is_varied(each) and float(np.ptp(each)) > 0.05 for each in log.duty.T)
    answers = [
        float(np.nanstd(each.values)) > 5.0 * each.floor
        for each in log.channels
        if each.role.startswith(("bemf", "speed"))
    ]
    return commanded and any(answers)


def swing_period(log: Log) -> float:
    """Period (s) of commands that do little but oscillate, as under bang-bang line following; 0 for other
    commands."""
    row = median_step(log.time)
    even = np.arange(log.time[0], log.time[-1], row)
    duty = log.duty[np.searchsorted(log.time, even, side="right") - 1]
    frequency = np.fft.rfftfreq(len(even), row)
    low, high = (
        np.searchsorted(frequency, each * frequency) for each in (1.0 / SWING_BAND_FACTOR, SWING_BAND_FACTOR)
    )
    asked = (frequency >= MIN_SWING_HZ) & (frequency <= MAX_SWING_HZ)
    for commands in (duty[:, 1] - duty[:, 0], duty.sum(axis=1)):
        power = np.abs(np.fft.rfft(commands - commands.mean())) ** 2
        total = np.concatenate([[0.0], np.cumsum(power)])
        shares = np.where(asked, total[np.minimum(high, len(power))] - total[low], 0.0)
        if not shares.max() > MIN_SWING_POWER_SHARE * total[-1]:
            continue
        best = int(np.argmax(shares))
        inside = slice(low[best], high[best])
        band = power[inside]
        middle = float(frequency[inside] @ band / band.sum())
        if middle >= MIN_SWING_HZ and np.sort(band)[-CLOCK_LINES:].sum() < MAX_CLOCK_SHARE * band.sum():
            return 1.0 / middle
    return 0.0
