"""Where stretches of a recording begin and end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def ends_of(time: Array, first: float, last: float, seconds: float) -> NDArray[np.intp]:
    """Rows of `time` at which stretches of so many seconds begin, from `first` to before `last`."""
    begins = np.arange(first, last, seconds)
    return np.searchsorted(time, begins[begins < last])  # arange may go a rounding beyond its end
