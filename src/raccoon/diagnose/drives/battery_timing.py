"""A battery's reading that answers the command of its own row.

By the format a row's command comes after its readings. Whoever works out a battery's voltage from what is
commanded has it after the command: its sag is at its largest then, where the simulation has the last of what
was before. With commands that change often that hid a resistance of 0.13 ohm behind something unknown. When
within a row such a reading was taken is nowhere else to be seen, so those of rows in which commands jump are
left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import Log

Array = NDArray[np.float64]

MIN_DUTY_JUMP = 0.3
"""Duty by which a command must rise or turn, so that the battery sags at once."""
MIN_JUMPS = 8
"""Such rows, of which it is said."""
MIN_IMMEDIATE_SHARE = 0.5
"""Part of what the voltage falls by until the row after such a one that is there at its own."""
MIN_DEVIATIONS = 4.0
"""Standard deviations by which it must fall at its own row."""
MIN_DROPPED_JUMP = 0.1
"""Duty from which a change of command is left out then."""
BATTERY_AFTER_COMMAND_NOTE = (
    "the battery's voltage sags in the very row of a command, where by the format it is read before: it is "
    "taken to be read after the command, and where commands jump it is not compared"
)


def without_battery_after_commands(log: Log) -> Log:
    """The log without readings of the battery that answer the command of their own row."""
    battery = log.channel("battery")
    if battery is None or not _sags_in_same_row(log.duty, battery.values):
        return log
    jumps = np.abs(np.diff(log.duty, axis=0, prepend=log.duty[:1])).max(axis=1) > MIN_DROPPED_JUMP
    values = np.where(jumps, np.nan, battery.values)
    channels = tuple(replace(each, values=values) if each is battery else each for each in log.channels)
    return replace(log, channels=channels, notes=(*log.notes, BATTERY_AFTER_COMMAND_NOTE))


def _sags_in_same_row(duty: Array, volts: Array) -> bool:
    """Whether a voltage falls at the rows at which commands ask for much more, and not after them."""
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
