"""Finds samples that are no readings: filler values without a new reading, battery voltages of 0, spikes.

A logger that writes 0 without a reading gave a battery half its voltage, with a probability of 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.commands import hold_until_next
from raccoon.diagnose.drives.log import ROLES
from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MAX_READING = 1e5
"""Upper bound of any sensor's reading in its own unit; wrong units give less and are reported by
`drives.units`."""
MIN_FILLER_COUNT, MIN_FILLER_SHARE = 10, 0.02
"""Least number and share of the samples in which a value must come between distant neighbours to be a
filler."""
MIN_DISTANCE_SHARE, MIN_DISTANCE_IN_NOISE = 0.3, 20.0
"""Least distance of both neighbours from a filler, relative to the largest distance from it and to the
sensor's smallest noise. (A wheel that creeps past 0 is near 0 before and after.)"""
MIN_NOISY_LEVELS, MIN_HELD_SHARE = 50, 0.4
"""Number of different values above which a reading has noise, so that hardly any equals the one before; and
share of equal neighbours above which a logger holds the values."""
MIN_FROZEN_S, MIN_COMMAND_CHANGE, RESPONSE_S = 0.4, 0.2, 0.15
"""Least duration of a frozen reading, s; change of its command meanwhile, duty; and time within which a sound
reading would have responded, s."""
MAX_SPIKE_SHARE, MAX_SPIKE_SAMPLES = 0.05, 2
"""Largest share of spikes, and largest number of samples of one spike."""
MIN_SPIKES = {"gyro": 1.0, "bemf": 300.0, "speed": 1.0, "battery": 1.0}
"""Least size of a spike by kind of reading, in its unit: a robot that drives straight may hit a bump."""
MIN_SPIKE_RANGE_RATIO = 1.5
"""Least distance of a spike from both neighbours, relative to the range from the 1st to the 99th
percentile."""


def without_invalid_samples(
    name: str, role: str, time: Array, values: Array, command: Array | None
) -> tuple[Array, tuple[SensorFault, ...]]:
    """The values with NaN in place of invalid samples, and their faults. command: the command that drives the
    measured quantity, None if unknown."""
    faults: list[SensorFault] = []

    def leave_out(rows: NDArray[np.intp], kind: str, text: str) -> None:
        nonlocal values
        if len(rows):
            faults.append(SensorFault(name, kind, f"{name} {text}"))
            values = values.copy()
            values[rows] = np.nan

    impossible = np.flatnonzero(np.abs(values) > MAX_READING)
    worst = float(values[impossible[0]]) if len(impossible) else 0.0
    leave_out(
        impossible, "impossible", f"has {len(impossible)} impossible values such as {worst:.3g}: left out"
    )
    known = np.flatnonzero(np.isfinite(values))
    if role == "battery":
        empty = known[values[known] <= 0.0]
        if len(empty) < len(known):  # a whole channel of them is reported by `drives.units`
            worst = float(values[empty[0]]) if len(empty) else 0.0
            share = _format_share(empty, known)
            leave_out(
                empty, "impossible", f"is {worst:g} V in {share}, which no battery has: {_BLANK_CELL_ADVICE}"
            )
    else:
        filler, rows = _find_filler(values[known], MIN_DISTANCE_IN_NOISE * ROLES[role][2])
        share = _format_share(rows, known)
        leave_out(
            known[rows],
            "impossible",
            f"is {filler:g} in {share}, far from the values beside it: {_BLANK_CELL_ADVICE}",
        )
        known = np.flatnonzero(np.isfinite(values))
        if command is not None:
            for value, rows in _find_frozen(time[known], values[known], command[known]):
                start, end = (float(time[known[each]]) for each in (rows[0], rows[-1]))
                leave_out(
                    known[rows], "frozen", f"stays at {value:g} from {start:.1f} to {end:.1f} s although the "
                    "commands change: it was not read, and is left out there"
                )  # fmt: skip
    if role == "gyro":  # a filtered back-EMF repeats itself while a wheel turns evenly
        values = _without_held_samples(values)
    known = np.flatnonzero(np.isfinite(values))
    spikes = known[_find_spikes(values[known], MIN_SPIKES[role.partition("_")[0]])]
    worst = float(values[spikes[0]]) if len(spikes) else 0.0
    text = f"has {len(spikes)} outliers such as {worst:.4g}, far from the values beside them: left out"
    leave_out(spikes, "impossible", text)
    return values, tuple(faults)


_BLANK_CELL_ADVICE = "left out; leave a cell blank where nothing was read"


def _format_share(rows: NDArray[np.intp], known: NDArray[np.intp]) -> str:
    return f"{100.0 * len(rows) / max(len(known), 1):.3g} % of its samples"


def _with_nan(values: Array, rows: NDArray[np.intp]) -> Array:
    blanked = values.copy()
    blanked[rows] = np.nan
    return blanked


def command_behind(role: str, columns: Mapping[str, Array], robot: RobotConfig) -> Array | None:
    """The command that drives a role's quantity: a wheel's duty, or half the difference of both for the gyro;
    None if it is missing."""
    ports = {"left": robot.drive.left, "right": robot.drive.right}
    commands = {
        side: (-1.0 if robot.motor(port).inverted else 1.0) * hold_until_next(columns[f"motor.{port}.duty"])
        for side, port in ports.items()
        if f"motor.{port}.duty" in columns
    }
    if role == "gyro":
        return 0.5 * (commands["right"] - commands["left"]) if len(commands) == len(ports) else None
    return commands.get(role.partition("_")[2])


def _find_frozen(time: Array, known: Array, command: Array) -> list[tuple[float, NDArray[np.intp]]]:
    """Value and rows of each frozen stretch: a constant reading, away from 0, during which the command
    changes."""
    if len(known) < MIN_FILLER_COUNT:
        return []
    min_size = MIN_DISTANCE_SHARE * float(np.percentile(np.abs(known), 99.0))
    edges = np.flatnonzero(np.concatenate([[True], np.diff(known) != 0.0, [True]]))
    found = []
    for start, end in pairwise(edges.tolist()):
        if abs(known[start]) < min_size or time[end - 1] - time[start] < MIN_FROZEN_S:
            continue
        until = int(np.searchsorted(time, time[end - 1] - RESPONSE_S))
        if until > start and float(np.ptp(command[start:until])) > MIN_COMMAND_CHANGE:
            found.append((float(known[start]), np.arange(start, end)))
    return found


def _find_filler(known: Array, min_noise_distance: float) -> tuple[float, NDArray[np.intp]]:
    """The most frequent value, and the rows in which it is a filler, if both neighbours are far from it on
    the same side in enough places."""
    nothing = np.zeros(0, np.intp)
    if len(known) == 0:
        return 0.0, nothing
    levels, counts = np.unique(known, return_counts=True)
    value = float(levels[np.argmax(counts)])
    offset = known - value
    if value in (levels[0], levels[-1]) or counts.max() < max(
        MIN_FILLER_COUNT, MIN_FILLER_SHARE * len(known)
    ):
        return value, nothing  # an extreme value may be saturation
    min_distance = max(MIN_DISTANCE_SHARE * float(np.percentile(np.abs(offset), 99.0)), min_noise_distance)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], offset == 0.0, [False]]).astype(int)))
    is_filler, count = np.zeros(len(known), bool), 0
    for start, end in edges.reshape(-1, 2):
        if start == 0 or end == len(known):
            continue
        before, after = float(offset[start - 1]), float(offset[end])
        if before * after > 0.0 and min(abs(before), abs(after)) > min_distance:
            is_filler[start:end] = True
            count += 1
    enough = count >= MIN_FILLER_COUNT and float(is_filler.mean()) > MIN_FILLER_SHARE
    return value, np.flatnonzero(offset == 0.0) if enough else nothing


def _without_held_samples(values: Array) -> Array:
    """The values with NaN in rows in which a logger only held the last one. A gyro of 50 Hz in rows of 200 Hz
    was diagnosed as a slip of 8 ms, and as none with its new rows alone."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < MIN_FILLER_COUNT or len(np.unique(values[known])) < MIN_NOISY_LEVELS:
        return values
    held = np.diff(values[known], prepend=np.nan) == 0.0
    turning = np.abs(values[known]) > MIN_DISTANCE_SHARE * float(np.percentile(np.abs(values[known]), 99.0))
    if not turning.any() or float(held[turning].mean()) < MIN_HELD_SHARE:
        return values
    return _with_nan(values, known[held])


def _find_spikes(known: Array, min_spike: float) -> Flags:
    """Flags of spikes: up to `MAX_SPIKE_SAMPLES` samples that differ from both neighbours by more than the
    usual range of all samples; none if there would be too many."""
    spikes = np.zeros(len(known), bool)
    if len(known) < 100:
        return spikes
    threshold = max(MIN_SPIKE_RANGE_RATIO * float(np.subtract(*np.percentile(known, [99.0, 1.0]))), min_spike)
    # The first and the last sample have one neighbour, which is mirrored to their other side.
    around = np.pad(known, MAX_SPIKE_SAMPLES, mode="reflect")
    flagged = np.zeros(len(around), bool)
    for length in range(1, MAX_SPIKE_SAMPLES + 1):
        before, after = around[: -length - 1], around[length + 1 :]
        inner = np.lib.stride_tricks.sliding_window_view(around, length)[1:-1]
        low, high = np.minimum(before, after), np.maximum(before, after)
        is_outside = (inner.min(axis=1) > high + threshold) | (inner.max(axis=1) < low - threshold)
        for start in np.flatnonzero(is_outside):
            flagged[start + 1 : start + 1 + length] = True
    spikes = flagged[MAX_SPIKE_SAMPLES:-MAX_SPIKE_SAMPLES]
    return spikes if float(spikes.mean()) <= MAX_SPIKE_SHARE else np.zeros(len(known), bool)
