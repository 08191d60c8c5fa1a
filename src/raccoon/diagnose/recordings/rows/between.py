"""Rows that nobody recorded: a drive that a program has brought to another rate by straight lines.

Between two samples a command holds and then jumps. Interpolated it is a ramp, which a motor follows as late
commands: of sound robots at 2 and 1 ms it made a latency of 4 and 6 ms, each with a probability of 1.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError

Columns = Mapping[str, NDArray[np.float64]]

FEWEST = 200
"""Rows in which a reading changes that tell whether it does so by straight lines."""
STRAIGHT = 1e-5
"""Part of a step by which the next one may be another, on a straight line."""
OFTEN = 0.08
"""Share of such rows. It is 0.2 with five rows for two samples and 0.02 at most without interpolation."""
LONGEST = 50
"""Rows of one line. Without noise a wheel that speeds up evenly is on one for longer."""
LEVELS = 20_000
"""A reading's largest value over its finest step, up to which it is a word of some device, in whatever unit:
of whole counts many steps are alike. What is interpolated has as many levels as digits."""


def check_recorded(columns: Columns) -> None:
    """Raise TraceError where the readings of all wheels are on straight lines between rows that are not."""
    wheels = {name: each for name, each in columns.items() if name.endswith((".bemf", ".speed"))}
    shares = {name: _interpolated(each) for name, each in wheels.items()}
    if not shares or min(shares.values()) < OFTEN:
        return
    name, share = min(shares.items(), key=lambda each: each[1])
    raise TraceError(
        f"{name} is on a straight line between the rows beside it in {100.0 * share:.0f} % of the rows: the "
        "recording was brought to another rate by interpolation, and when a command changed between two "
        "samples is no longer known. Export the rows as they were recorded, or with the last value held"
    )


def _interpolated(values: NDArray[np.float64]) -> float:
    """Share of the rows, of those in which a reading changes, that are on a short straight line."""
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    moves = steps[1:] != 0.0
    if moves.sum() < FEWEST or _in_words(known):
        return 0.0
    straight = moves & (np.abs(np.diff(steps)) <= STRAIGHT * np.abs(steps[1:]))
    ends = np.flatnonzero(np.diff(np.concatenate([[False], straight, [False]]).astype(int)))
    lengths = ends[1::2] - ends[::2]
    return float(lengths[lengths <= LONGEST].sum() / moves.sum())


def _in_words(known: NDArray[np.float64]) -> bool:
    largest = float(np.abs(known).max())
    levels = np.diff(np.unique(known))
    return largest / float(levels[levels > 1e-9 * largest].min(initial=largest)) <= LEVELS
