"""The speed that an encoder reads: counts over a window, so it is late by half of the window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.hypotheses.coordinates import Coordinate, Setting, Settings
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]

WINDOW: Setting = ("encoder", None, "window")
"""s over which the counts of a speed are taken."""
WINDOW_STD, MAX_WINDOW_STDS = 0.01, 3.5
"""Prior standard deviation (s, or one row of the recording where that is longer) of the window about one row,
and its bound in standard deviations. robot.toml does not have the window, and it is not a fault: a board
counts over its cycle, or over several where a count is coarse."""
MIN_WINDOW = 1e-6
"""s; a shorter window counts as none."""


def has_encoders(log: Log) -> bool:
    """Whether any wheel has an encoder, alone or beside its back-EMF."""
    return any(each.role.startswith("speed_") for each in log.channels)


def encoder_settings(log: Log) -> Settings:
    """The neutral window: one row of the log. Empty where the log has no encoders."""
    return {WINDOW: _row_period(log)} if has_encoders(log) else {}


def encoder_coordinates(log: Log) -> tuple[Coordinate, ...]:
    """The coordinate of the window's deviation from one row; none where the log has no encoders."""
    if not has_encoders(log):
        return ()
    row = _row_period(log)
    width = max(WINDOW_STD, row)
    return (
        Coordinate("encoder.window", (WINDOW,), lambda u: width * u, low=-row / width, high=MAX_WINDOW_STDS),
    )


def _row_period(log: Log) -> float:
    return median_step(log.time)


def average_over_window(time: Array, speeds: Array, windows: Array) -> Array:
    """Means of speeds (robots, rows) over the window of each robot (robots,) that ends at each row.

    The speed is linear between rows, and constant before the first.
    """
    found = np.array(speeds, dtype=np.float64)
    for window in np.unique(windows[windows > MIN_WINDOW]):
        which = windows == window
        found[which] = _window_means(time, found[which], float(window))
    return found


def _window_means(time: Array, speeds: Array, window: float) -> Array:
    steps = np.diff(time)
    angles = np.zeros_like(speeds)
    np.cumsum(0.5 * (speeds[:, 1:] + speeds[:, :-1]) * steps, axis=1, out=angles[:, 1:])
    begin = time - window
    row = np.clip(np.searchsorted(time, begin, side="right") - 1, 0, len(time) - 2)
    since = begin - time[row]
    early = since < 0.0
    slope = np.where(early, 0.0, (speeds[:, row + 1] - speeds[:, row]) / steps[row])
    before = angles[:, row] + speeds[:, row] * since + 0.5 * slope * since**2
    return np.asarray((angles - before) / window, np.float64)
