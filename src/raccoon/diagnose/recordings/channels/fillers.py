"""Numbers that stand for nothing: zeros where a sensor had nothing new, batteries of 0 V, spikes.

A logger that writes 0 where it read nothing made a battery of half the voltage, with a probability of 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.commands import until_next
from raccoon.diagnose.drives.log import ROLES
from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

IMPOSSIBLE = 1e5
"""No sensor of a robot reads more in its own unit; wrong units are below it and are named by `quality`."""
FEWEST, OFTEN = 10, 0.02
"""Times, and share of the samples, that one value comes between others before it is none."""
AWAY, FLOORS = 0.3, 20.0
"""By how much of the largest distance from it both neighbours are away, and of a sensor's smallest noise. A
wheel that creeps past 0 is near to it before and after."""
MANY, HELD = 50, 0.4
"""Different values of a reading that has noise, so that hardly one is as the one before; and share of those
that are where a logger holds them."""
STAYS, CHANGES, ANSWERS = 0.4, 0.2, 0.15
"""s for which a reading stays that is frozen, the duty by which its command changes meanwhile, and s in which
it would have answered."""
SPIKES, LONGEST = 0.05, 2
"""Share of the samples that may be spikes, and samples that one may last."""
LEAST_SPIKES = {"gyro": 1.0, "bemf": 300.0, "speed": 1.0, "battery": 1.0}
"""What a spike is at least, by the kind of a reading: a robot that drives straight may hit a bump."""
USUAL = 1.5
"""Of the range from the first to the last hundredth of the samples, by which a spike leaves both neighbours.
"""


def without_fillers(
    name: str, role: str, time: Array, values: Array, command: Array | None
) -> tuple[Array, tuple[SensorFault, ...]]:
    """Values that are NaN where a number stands for none, and what these were. command: what moves what is
    read, None where nobody knows."""
    faults: list[SensorFault] = []

    def left_out(rows: NDArray[np.intp], kind: str, text: str) -> None:
        nonlocal values
        if len(rows):
            faults.append(SensorFault(name, kind, f"{name} {text}"))
            values = values.copy()
            values[rows] = np.nan

    wild = np.flatnonzero(np.abs(values) > IMPOSSIBLE)
    worst = float(values[wild[0]]) if len(wild) else 0.0
    left_out(wild, "impossible", f"has {len(wild)} impossible values such as {worst:.3g}: left out")
    known = np.flatnonzero(np.isfinite(values))
    if role == "battery":
        empty = known[values[known] <= 0.0]
        if len(empty) < len(known):  # all of it is for `quality` to say
            worst = float(values[empty[0]]) if len(empty) else 0.0
            share = _percent(empty, known)
            left_out(empty, "impossible", f"is {worst:g} V in {share}, which no battery is: {_BLANK}")
    else:
        filler, rows = _filler(values[known], FLOORS * ROLES[role][2])
        share = _percent(rows, known)
        left_out(known[rows], "impossible", f"is {filler:g} in {share}, between others far from it: {_BLANK}")
        known = np.flatnonzero(np.isfinite(values))
        if command is not None:
            for value, rows in _frozen(time[known], values[known], command[known]):
                start, end = (float(time[known[each]]) for each in (rows[0], rows[-1]))
                left_out(
                    known[rows], "frozen", f"stays at {value:g} from {start:.1f} to {end:.1f} s although the "
                    "commands change: it was not read, and is left out there"
                )  # fmt: skip
    if role == "gyro":  # a back-EMF that is filtered repeats itself while a wheel turns evenly
        values = _only_new(values)
    known = np.flatnonzero(np.isfinite(values))
    spikes = known[_spikes(values[known], LEAST_SPIKES[role.partition("_")[0]])]
    worst = float(values[spikes[0]]) if len(spikes) else 0.0
    told = f"has {len(spikes)} values such as {worst:.4g} that their neighbours know nothing of: left out"
    left_out(spikes, "impossible", told)
    return values, tuple(faults)


_BLANK = "left out; leave a cell blank where nothing was read"


def _percent(rows: NDArray[np.intp], known: NDArray[np.intp]) -> str:
    return f"{100.0 * len(rows) / max(len(known), 1):.3g} % of its samples"


def _blank(values: Array, rows: NDArray[np.intp]) -> Array:
    found = values.copy()
    found[rows] = np.nan
    return found


def command_of(role: str, columns: Mapping[str, Array], robot: RobotConfig) -> Array | None:
    """What moves what a role reads: a wheel's command, or what turns the robot; None where it is missing."""
    ports = {"left": robot.drive.left, "right": robot.drive.right}
    found = {
        side: (-1.0 if robot.motor(port).inverted else 1.0) * until_next(columns[f"motor.{port}.duty"])
        for side, port in ports.items()
        if f"motor.{port}.duty" in columns
    }
    if role == "gyro":
        return 0.5 * (found["right"] - found["left"]) if len(found) == len(ports) else None
    return found.get(role.partition("_")[2])


def _frozen(time: Array, known: Array, command: Array) -> list[tuple[float, NDArray[np.intp]]]:
    """Stretches of one value, away from 0, in which the command changes."""
    if len(known) < FEWEST:
        return []
    least = AWAY * float(np.percentile(np.abs(known), 99.0))
    edges = np.flatnonzero(np.concatenate([[True], np.diff(known) != 0.0, [True]]))
    found = []
    for start, end in pairwise(edges.tolist()):
        if abs(known[start]) < least or time[end - 1] - time[start] < STAYS:
            continue
        until = int(np.searchsorted(time, time[end - 1] - ANSWERS))
        if until > start and float(np.ptp(command[start:until])) > CHANGES:
            found.append((float(known[start]), np.arange(start, end)))
    return found


def _filler(known: Array, least: float) -> tuple[float, NDArray[np.intp]]:
    """The value that comes most often, and where it stands for none: most times that it comes, both
    neighbours are far from it, to the same side."""
    nothing = np.zeros(0, np.intp)
    if len(known) == 0:
        return 0.0, nothing
    seen, counts = np.unique(known, return_counts=True)
    value = float(seen[np.argmax(counts)])
    off = known - value
    if value in (seen[0], seen[-1]) or counts.max() < max(FEWEST, OFTEN * len(known)):
        return value, nothing  # a largest value may be where a reading is cut off
    far = max(AWAY * float(np.percentile(np.abs(off), 99.0)), least)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], off == 0.0, [False]]).astype(int)))
    found, times = np.zeros(len(known), bool), 0
    for start, end in edges.reshape(-1, 2):
        if start == 0 or end == len(known):
            continue
        before, after = float(off[start - 1]), float(off[end])
        if before * after > 0.0 and min(abs(before), abs(after)) > far:
            found[start:end] = True
            times += 1
    enough = times >= FEWEST and float(found.mean()) > OFTEN
    return value, np.flatnonzero(off == 0.0) if enough else nothing


def _only_new(values: Array) -> Array:
    """Values that are NaN where a logger wrote the last one once more. A gyro of 50 Hz in rows of 200 Hz was
    a slip of 8 ms; with the rows in which it was new it is none."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < FEWEST or len(np.unique(values[known])) < MANY:
        return values
    again = np.diff(values[known], prepend=np.nan) == 0.0
    turning = np.abs(values[known]) > AWAY * float(np.percentile(np.abs(values[known]), 99.0))
    if not turning.any() or float(again[turning].mean()) < HELD:
        return values
    return _blank(values, known[again])


def _spikes(known: Array, least: float) -> Flags:
    """Samples that leave both neighbours by more than all others are apart, and come back at once."""
    found = np.zeros(len(known), bool)
    if len(known) < 100:
        return found
    usual = max(USUAL * float(np.subtract(*np.percentile(known, [99.0, 1.0]))), least)
    # The first sample and the last have one neighbour, which stands on their other side as well.
    around = np.pad(known, LONGEST, mode="reflect")
    flagged = np.zeros(len(around), bool)
    for length in range(1, LONGEST + 1):
        before, after = around[: -length - 1], around[length + 1 :]
        inner = np.lib.stride_tricks.sliding_window_view(around, length)[1:-1]
        low, high = np.minimum(before, after), np.maximum(before, after)
        out = (inner.min(axis=1) > high + usual) | (inner.max(axis=1) < low - usual)
        for start in np.flatnonzero(out):
            flagged[start + 1 : start + 1 + length] = True
    found = flagged[LONGEST:-LONGEST]
    return found if float(found.mean()) <= SPIKES else np.zeros(len(known), bool)
