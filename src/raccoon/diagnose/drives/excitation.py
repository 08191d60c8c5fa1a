"""How the commands excite a drive: whether it moves at all, and whether they swing."""

from __future__ import annotations

import numpy as np

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.response_models import is_varied
from raccoon.trace.recording import median_step

MIN_SWING_HZ, MAX_SWING_HZ = 4.0, 15.0
"""1/s. In slower ones the wheels' readings, 30 ms late, show what commands answer as in any drive."""
SWING_BAND_FACTOR = 1.25
"""Band of a swing: this factor to either side of its frequency."""
MIN_SWING_POWER_SHARE = 0.4
"""Part of the commands' power that is in such a band, where they swing: 0.6 to 0.8 of robots that were
steered by bang-bang, 0.18 at most of 250 other drives."""
CLOCK_LINES, MAX_CLOCK_SHARE = 6, 0.75
"""So many lines of a spectrum hold so much of the band where a clock has made the swing: a program that
wiggles on purpose, which says all about a robot."""


def is_driven(log: Log) -> bool:
    """Whether the commands change and the wheels answer: without that nothing can be told."""
    commanded = any(is_varied(each) and float(np.ptp(each)) > 0.05 for each in log.duty.T)
    answers = [
        float(np.nanstd(each.values)) > 5.0 * each.floor
        for each in log.channels
        if each.role.startswith(("bemf", "speed"))
    ]
    return commanded and any(answers)


def swing_period(log: Log) -> float:
    """Period (s) of commands that do little else than swing, as where bang-bang follows a line; 0 where they
    do not."""
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
