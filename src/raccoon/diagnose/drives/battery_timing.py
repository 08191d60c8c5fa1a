"""Battery readings that already respond to the command of their own row.

By the format, a row's command follows its readings. A logger that computes the battery voltage from the
command reads it after the command: the sag is then at its largest, where the simulation still has the last
value before the command. In a drive whose commands change often, that turned a resistance of 0.13 ohm into an
unknown effect. Nothing else shows when within a row the reading was taken, so readings in rows in which a
command jumps are left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import Log

Array = NDArray[np.float64]

MIN_DUTY_JUMP = 0.3
"""Least change of duty, to a larger magnitude or to the other sign, that makes the battery sag at once."""
MIN_JUMPS = 8
"""Least number of rows with such a change for a decision."""
MIN_IMMEDIATE_SHARE = 0.5
"""Share of the voltage drop up to the next row that must already be present in the row of the command."""
MIN_DEVIATIONS = 4.0
"""Least voltage drop in the row of the command, in standard deviations."""
MIN_DROPPED_JUMP = 0.1
"""Change of duty above which a row's battery reading is left out, if the battery is read after the
command."""
BATTERY_AFTER_COMMAND_NOTE = (
    "the battery's voltage sags in the same row as a command, although by the format it is read before: it "
    "is treated as read after the command, and is not compared where commands jump"
)


def without_battery_after_commands(log: Log) -> Log:
    """The log without battery readings that respond to the command of their own row, and with a note."""
    battery = log.channel("battery")
    if battery is None or not _sags_in_same_row(log.duty, battery.values):
        return log
    jumps = np.abs(np.diff(log.duty, axis=0, prepend=log.duty[:1])).max(axis=1) > MIN_DROPPED_JUMP
    values = np.where(jumps, np.nan, battery.values)
    channels = tuple(replace(each, values=values) if each is battery else each for each in log.channels)
    return replace(log, channels=channels, notes=(*log.notes, BATTERY_AFTER_COMMAND_NOTE))


def _sags_in_same_row(duty: Array, volts: Array) -> bool:
    """Whether the voltage drops in the very rows in which commands demand much more, and not in the rows
    after."""
    change = np.diff(duty, axis=0)
    more = np.any(np.sign(duty[1:]) * change > MIN_DUTY_JUMP, axis=1)
    rows = np.flatnonzero(more[:-1]) + 1
    before, own, after = volts[rows - 1], volts[rows], volts[rows + 1]
    known = np.isfinite(before) & np.isfinite(own) & np.isfinite(after)
    if known.sum() < MIN_JUMPS:
        return False
    falls, later = (own - before)[known], (np.minimum(own, after) - before)[known]
    quiet = np.diff(volts)[~more]
    noise = 1.48 * float(np.nanmedian(np.abs(quiet - np.nanmedian(quiet))))
    middle = float(np.median(falls))
    least = MIN_DEVIATIONS * max(noise, 0.001) / np.sqrt(known.sum())
    return middle < -least and middle < MIN_IMMEDIATE_SHARE * float(np.median(later))
