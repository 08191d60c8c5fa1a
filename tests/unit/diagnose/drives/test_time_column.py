"""What the times of rows tell about the clock behind them."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.diagnose.drives.time_column import rows_drift

RNG = np.random.default_rng(3)
ROWS = 2000
EVEN = 0.005 * np.arange(ROWS)
WOKEN_LATE = RNG.exponential(0.0002, ROWS)
SLEEPING = np.cumsum(0.010 + RNG.exponential(0.0003, ROWS))


@pytest.mark.parametrize(
    ("time", "drift"),
    [
        (EVEN, False),
        (1.1 * EVEN, False),  # a clock of 182 Hz is as even
        (EVEN + WOKEN_LATE, False),
        (np.delete(EVEN + WOKEN_LATE, RNG.choice(ROWS, 60, replace=False)), False),
        (SLEEPING, True),
        (np.delete(SLEEPING, RNG.choice(ROWS, 60, replace=False)), True),
        (np.array([0.0, 0.005]), False),
        (np.zeros(1), False),
    ],
    ids=["even", "another rate", "woken late", "rows lost", "sleeping", "sleeping, rows lost", "two", "one"],
)
def test_rows_drift_where_each_waits_for_the_one_before(time: np.ndarray, drift: bool) -> None:
    assert rows_drift(time) is drift
