"""Rejects drives that were resampled by linear interpolation.

A command holds between two samples and then jumps. Interpolated, it is a ramp, and the motor appears to
respond to late commands: fault-free robots resampled to 2 and 1 ms showed a latency of 4 and 6 ms, each with
a probability of 1.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.bins import runs_of_true

Columns = Mapping[str, NDArray[np.float64]]

MIN_CHANGING_ROWS = 200
"""Least number of rows in which a reading changes for a check of straight lines."""
LINE_TOLERANCE = 1e-5
"""Relative difference of two successive steps up to which they are on one straight line."""
MIN_INTERPOLATED_SHARE = 0.08
"""Least share of changing rows on straight lines in an interpolated recording. It is 0.2 with five rows for
two samples, and 0.02 at most without interpolation."""
MAX_LINE_ROWS = 50
"""Largest number of rows of a line that counts. Without noise, a wheel that accelerates uniformly is on one
for longer."""
MAX_DEVICE_LEVELS = 20_000
"""Ratio of a reading's largest value to its finest step up to which a device quantised it, in whatever unit:
with whole counts many steps are equal. Interpolated values have as many levels as digits."""
INTERPOLATED_MESSAGE = (
    "the recording was interpolated to another rate, so it is no longer known when commands changed. Export "
    "the rows as they were recorded, or with the last value held"
)
MIN_STILL_ROWS, MIN_STEP_SIZE, MAX_STEP_ROWS = 3, 0.05, 8
"""Least number of rows for which a command is constant before and after a step; least size of a step; and
largest number of rows that it takes."""
MIN_STEPS, MIN_INTERPOLATED_STEP_SHARE = 8, 0.8
"""Least number of steps, and least share of them that are straight lines and no jumps."""
STEP_LINE_TOLERANCE = 0.03
"""Tolerance on the changes of a step's inner rows for a straight line, as a share of the step."""
MIN_ROWS_BETWEEN_ALONE, MIN_FIRST_SHARE_STD, MAX_LARGEST_SHARE_STD = 1.7, 0.05, 0.03
"""Mean number of rows within a step above which the other two thresholds decide alone. After interpolation,
the first row's share of a step is random (its standard deviation is 0.1 to 0.2; it is 0 for a filter, and for
a ramp over a fixed number of rows), and the largest share is constant (0.01; not for a ramp of a fixed
rate)."""
MIN_ROWS_BETWEEN, MIN_LONG_STEPS, ROWS_TIMES_SHARE_TOLERANCE, MAX_SHARE_RATIO = 1.12, 3, 0.15, 1.05
"""Criteria for fewer rows, down to the first number (with one row, as at the same rate, nothing wrong was
named): in steps long enough to hold a whole row, that row's share times the mean number of rows must be 1
within the tolerance (0.09 at most was seen; for a ramp it is less than 1), and no row of any step may exceed
that share."""
MIN_VARIATION_RATIO = 0.5
"""Ratio of the coefficients of variation of the steps' largest changes and of their largest shares. It is
smaller if a ramp of a fixed rate was recorded at some rows only: the larger the step, the smaller its
shares."""


def check_not_interpolated(columns: Columns) -> None:
    """Raise TraceError if a recording was interpolated: the readings of all wheels are on straight lines in
    many rows, or commands step through intermediate rows."""
    for name, each in columns.items():
        if name.endswith(".duty") and _has_interpolated_steps(each[np.isfinite(each)]):
            text = f"{name} has rows with values between two commands"
            raise TraceError(f"{text}: {INTERPOLATED_MESSAGE}")
    wheels = {name: each for name, each in columns.items() if name.endswith((".bemf", ".speed"))}
    shares = {name: _interpolated_share(each) for name, each in wheels.items()}
    if not shares or min(shares.values()) < MIN_INTERPOLATED_SHARE:
        return
    name, share = min(shares.items(), key=lambda each: each[1])
    text = f"{name} is on a straight line between those beside it in {100.0 * share:.0f} % of the rows"
    raise TraceError(f"{text}: {INTERPOLATED_MESSAGE}")


def _has_interpolated_steps(duty: NDArray[np.float64]) -> bool:
    """Whether most steps of a command pass through rows with a random share of the step."""
    lines, jumps = _find_line_steps(duty)
    if len(lines) < MIN_STEPS or len(lines) < MIN_INTERPOLATED_STEP_SHARE * (len(lines) + jumps):
        return False
    first_shares = [float(shares[0]) for _, shares in lines]
    largest_shares = [float(shares.max()) for _, shares in lines if len(shares) > 2]
    largest_changes = [float(shares.max()) * size for size, shares in lines if len(shares) > 2]
    mean_rows = float(np.mean([len(shares) - 1 for _, shares in lines]))
    if mean_rows < MIN_ROWS_BETWEEN or len(largest_shares) < MIN_LONG_STEPS:
        return False
    if np.std(first_shares) <= MIN_FIRST_SHARE_STD or np.std(largest_shares) >= MAX_LARGEST_SHARE_STD:
        return False
    min_variation = MIN_VARIATION_RATIO * _coefficient_of_variation(largest_shares)
    if _coefficient_of_variation(largest_changes) < min_variation:
        return False
    if mean_rows >= MIN_ROWS_BETWEEN_ALONE:
        return True
    mean_largest = float(np.mean(largest_shares))
    max_share = max(float(shares.max()) for _, shares in lines)
    return (
        abs(mean_rows * mean_largest - 1.0) < ROWS_TIMES_SHARE_TOLERANCE
        and max_share < MAX_SHARE_RATIO * mean_largest
    )


def _find_line_steps(duty: NDArray[np.float64]) -> tuple[list[tuple[float, NDArray[np.float64]]], int]:
    """Isolated steps of a command along a straight line, each with its size and the rows' shares of it; and
    the number of other isolated steps."""
    changes = np.diff(duty)
    spans = runs_of_true(changes != 0.0)
    next_starts = [*(start for start, _ in spans[1:]), len(duty)]
    lines, jumps, previous_end = [], 0, -MIN_STILL_ROWS
    for (start, end), next_start in zip(spans, next_starts, strict=False):
        is_isolated = start - previous_end >= MIN_STILL_ROWS and next_start - end >= MIN_STILL_ROWS
        size, previous_end, rows = float(duty[end] - duty[start]), end, changes[start:end]
        is_small = abs(size) < MIN_STEP_SIZE
        if not is_isolated or is_small or len(rows) > MAX_STEP_ROWS or (rows * size < 0.0).any():
            continue
        if len(rows) == 1 or (len(rows) > 2 and np.ptp(rows[1:-1]) > STEP_LINE_TOLERANCE * abs(size)):
            jumps += 1
        else:
            lines.append((abs(size), rows / size))
    return lines, jumps


def _coefficient_of_variation(sizes: list[float]) -> float:
    return float(np.std(sizes) / np.mean(sizes))


def _interpolated_share(values: NDArray[np.float64]) -> float:
    """Share of a reading's changing rows that are on a short straight line."""
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    changing = steps[1:] != 0.0
    if changing.sum() < MIN_CHANGING_ROWS or _is_quantised(known):
        return 0.0
    straight = changing & (np.abs(np.diff(steps)) <= LINE_TOLERANCE * np.abs(steps[1:]))
    lengths = [end - start for start, end in runs_of_true(straight)]
    return float(sum(each for each in lengths if each <= MAX_LINE_ROWS) / changing.sum())


def _is_quantised(values: NDArray[np.float64]) -> bool:
    largest = float(np.abs(values).max())
    levels = np.diff(np.unique(values))
    return largest / float(levels[levels > 1e-9 * largest].min(initial=largest)) <= MAX_DEVICE_LEVELS
