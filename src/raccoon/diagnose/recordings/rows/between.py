"""Rows that nobody recorded: a drive that a program has brought to another rate by straight lines.

Between two samples a command holds and then jumps. Interpolated it is a ramp, which a motor follows as late
commands: of sound robots at 2 and 1 ms it made a latency of 4 and 6 ms, each with a probability of 1.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.binned import runs

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
SAID = (
    "the recording was brought to another rate by interpolation, and when a command changed between two "
    "samples is no longer known. Export the rows as they were recorded, or with the last value held"
)
STILL, LARGE, LONG = 3, 0.05, 8
"""Rows for which a command stays before and after a step, size of one that tells, and rows that it takes at
most."""
FEWEST_STEPS, MOSTLY = 8, 0.8
"""Steps that tell, and share of them that are straight lines and no jumps."""
STRAIGHTLY = 0.03
"""Part of a step by which its rows, the first and the last aside, may move differently on a straight line."""
MORE, UNLIKE, ALIKE = 1.7, 0.05, 0.03
"""Rows within a step, on average, from which these tell alone. Of interpolation the share of a step that its
first row makes is chance (its standard deviation 0.1 to 0.2; of a filter and a ramp in so many rows 0), and
the largest share is the same (0.01; of a ramp by so much a row it is not)."""
FEW, FEWEST_LARGEST, NEAR_ONE, NO_LARGER = 1.12, 3, 0.15, 1.05
"""With fewer rows, from so many on (with one, as at the same rate, nothing wrong was named), also the share
of a step that a whole row makes, which some steps show, times the rows is 1, by so much (0.09 at most; of a
ramp it is less), and no row of any step makes more."""

AS_EVEN = 0.5
"""Of how unlike the largest shares of steps are, how unlike the largest changes may be where a ramp made them
of which only some rows were recorded: the larger the step, the smaller its shares."""


def check_recorded(columns: Columns) -> None:
    """Raise TraceError where a recording was interpolated: the readings of all wheels are on straight lines
    between rows that are not, or commands step by rows between two that are."""
    for name, each in columns.items():
        if name.endswith(".duty") and _stepped(each[np.isfinite(each)]):
            raise TraceError(f"{name} has rows between two commands that are a part of either: {SAID}")
    wheels = {name: each for name, each in columns.items() if name.endswith((".bemf", ".speed"))}
    shares = {name: _interpolated(each) for name, each in wheels.items()}
    if not shares or min(shares.values()) < OFTEN:
        return
    name, share = min(shares.items(), key=lambda each: each[1])
    raise TraceError(
        f"{name} is on a straight line between those beside it in {100.0 * share:.0f} % of the rows: {SAID}"
    )


def _stepped(duty: NDArray[np.float64]) -> bool:
    """Whether most steps of a command go by rows whose share of the step is by chance."""
    steps = np.diff(duty)
    changes = runs(steps != 0.0)
    first, largest, changed, between, jumps, last, most = [], [], [], [], 0, -STILL, 0.0
    for (start, end), after in zip(changes, [*(start for start, _ in changes[1:]), len(duty)], strict=False):
        still = start - last >= STILL and after - end >= STILL
        size, last, way = float(duty[end] - duty[start]), end, steps[start:end]
        if not still or abs(size) < LARGE or len(way) > LONG or (way * size < 0.0).any():
            continue
        if len(way) == 1 or (len(way) > 2 and np.ptp(way[1:-1]) > STRAIGHTLY * abs(size)):
            jumps += 1
            continue
        between.append(len(way) - 1)
        first.append(float(way[0] / size))
        most = max(most, float((way / size).max()))
        if len(way) > 2:
            largest.append(float((way / size).max()))
            changed.append(largest[-1] * abs(size))
    if len(between) < FEWEST_STEPS or len(between) < MOSTLY * (len(between) + jumps):
        return False
    rows = float(np.mean(between))
    if rows < FEW or len(largest) < FEWEST_LARGEST or np.std(first) <= UNLIKE or np.std(largest) >= ALIKE:
        return False
    if _unlike(changed) < AS_EVEN * _unlike(largest):
        return False
    whole = float(np.mean(largest))
    return rows >= MORE or (abs(rows * whole - 1.0) < NEAR_ONE and most < NO_LARGER * whole)


def _unlike(sizes: list[float]) -> float:
    return float(np.std(sizes) / np.mean(sizes))


def _interpolated(values: NDArray[np.float64]) -> float:
    """Share of the rows, of those in which a reading changes, that are on a short straight line."""
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    moves = steps[1:] != 0.0
    if moves.sum() < FEWEST or _in_words(known):
        return 0.0
    straight = moves & (np.abs(np.diff(steps)) <= STRAIGHT * np.abs(steps[1:]))
    lengths = [end - start for start, end in runs(straight)]
    return float(sum(each for each in lengths if each <= LONGEST) / moves.sum())


def _in_words(known: NDArray[np.float64]) -> bool:
    largest = float(np.abs(known).max())
    levels = np.diff(np.unique(known))
    return largest / float(levels[levels > 1e-9 * largest].min(initial=largest)) <= LEVELS
