"""Resting voltage of a cell as a function of its state of charge, by chemistry.

Typical curves at 20 degrees and rest (of the chemistry, not of one product): (state of charge, V). In the
flat middle of LiFePO4 the voltage says little about the charge, and the standard deviations of the result
show that.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

Curve = tuple[tuple[float, float], ...]

CURVES: Mapping[str, Curve] = {
    "lifepo4": (
        (0.0, 2.80), (0.05, 3.05), (0.1, 3.16), (0.2, 3.22), (0.3, 3.25), (0.4, 3.28), (0.5, 3.295),
        (0.6, 3.305), (0.7, 3.32), (0.8, 3.335), (0.9, 3.345), (0.97, 3.38), (1.0, 3.50),
    ),
    "lipo": (
        (0.0, 3.30), (0.05, 3.55), (0.1, 3.66), (0.2, 3.73), (0.3, 3.77), (0.4, 3.80), (0.5, 3.84),
        (0.6, 3.89), (0.7, 3.95), (0.8, 4.03), (0.9, 4.11), (1.0, 4.20),
    ),
    "nimh": (
        (0.0, 1.00), (0.05, 1.13), (0.1, 1.18), (0.2, 1.22), (0.3, 1.24), (0.4, 1.25), (0.5, 1.26),
        (0.6, 1.27), (0.7, 1.285), (0.8, 1.30), (0.9, 1.33), (1.0, 1.40),
    ),
}  # fmt: skip


def charge_at(chemistry: str, cell_voltage: float) -> float:
    """State of charge, 0..1, at a cell's resting voltage; 0 or 1 beyond the curve."""
    curve = _curve(chemistry)
    if cell_voltage <= curve[0][1]:
        return 0.0
    for (low, low_volts), (high, high_volts) in itertools.pairwise(curve):
        if cell_voltage < high_volts:
            return low + (high - low) * (cell_voltage - low_volts) / (high_volts - low_volts)
    return 1.0


def _curve(chemistry: str) -> Curve:
    try:
        return CURVES[chemistry]
    except KeyError:
        raise ValueError(f"chemistry is {chemistry!r}: allowed are {', '.join(CURVES)}") from None
