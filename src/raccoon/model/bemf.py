"""What a board's back-EMF filter does to time: how far filtered speeds and their sum lag behind the motor."""

from __future__ import annotations

import math


def counter_lag(time_constant: float, sample_time: float) -> float:
    """S by which a counter is behind, as a multiple of the filtered back-EMF: the angle now is counter + lag
    times filtered speed.

    The filter f += (1 - k) (raw - f) with k = exp(-sample_time / time_constant) sums to
    sum(raw) = sum(f) + k / (1 - k) f. The sum of samples, each counted for the whole time since the last one,
    is ahead of the angle by half a sample. Below 0, where the filter is that fast, 0 is given.
    """
    if time_constant <= 0.0:
        return 0.0
    return max(sample_time / math.expm1(sample_time / time_constant) - 0.5 * sample_time, 0.0)
