from __future__ import annotations

import numpy as np

from raccoon.diagnose.recordings.reference.stretches import stretch_starts


def test_no_stretch_begins_beyond_the_last_row() -> None:
    """Of a drive of 240 s with a reference the last of them was one beyond it by a rounding: IndexError."""
    time = np.asarray(1.0 + 0.005 * np.arange(661), np.float64)
    assert np.arange(time[0], time[-1], 0.1)[-1] > time[-1]  # which is why
    ends = stretch_starts(time, time[0], time[-1], 0.1)
    assert len(ends) == 33
    assert np.abs(time[ends] - 1.0 - 0.1 * np.arange(33)).max() < 0.006
    assert time[ends[-1]] < time[-1]
