"""Joins several recordings of one robot into one log: together, short ones show what none shows alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.features import SETTLING_S
from raccoon.diagnose.drives.log import Channel, Clocks, Log, Run
from raccoon.diagnose.drives.stops import motors_brake

PAUSE_S = 5.0
"""Pause between two recordings, s, without commands, in which nothing is compared."""


@contextmanager
def naming_recording(number: int) -> Iterator[None]:
    """Add to a TraceError which of several recordings it concerns. number: its index, from 0."""
    try:
        yield
    except TraceError as error:
        raise TraceError(f"recording {number + 1}: {error}") from None


MAX_TOTAL_S = 600.0
"""Longest total duration, s: 24 recordings of 25 s take 3 GB of memory, and 20 times as long as one of 40
s."""


def join_logs(logs: Sequence[Log]) -> Log:
    """One log of several logs in sequence, with the channels that all have. What was known of each is kept.

    Raises TraceError if they have no channel in common or are longer than `MAX_TOTAL_S`.
    """
    if len(logs) == 1:
        return logs[0]
    seconds = sum(each.seconds for each in logs)
    if seconds > MAX_TOTAL_S:
        raise TraceError(
            f"the recordings have {seconds:.0f} s; at most {MAX_TOTAL_S:g} s are fitted together, which "
            "takes 3 GB: name fewer"
        )
    roles = [each.role for each in logs[0].channels if all(log.channel(each.role) for log in logs[1:])]
    if not roles:
        raise TraceError(
            "the recordings have no channel in common: name recordings of one robot and one logger"
        )
    begin, parts = float(logs[0].time[0]), []
    for each in logs:
        parts.append(_shifted(_with_stop(each), begin - float(each.time[0])))
        begin = float(parts[-1].time[-1]) + PAUSE_S
    gaps = [(float(before.time[-1]), float(after.time[0]) + SETTLING_S) for before, after in pairwise(parts)]
    return Log(
        np.concatenate([each.time for each in parts]),
        np.concatenate([each.duty for each in parts]),
        tuple(_joined_channel([_channel(each, role) for each in parts]) for role in roles),
        tuple(dict.fromkeys(_missing_names(logs, roles))),
        (_start_times_note(parts), *_dropped_channel_notes(logs, roles), *_numbered_notes(logs)),
        tuple(sorted((*(span for each in parts for span in each.lost), *gaps))),
        tuple(span for each in parts for span in each.held),
        brake=_joined_brakes(parts),
        loads=tuple(load for each in parts for load in each.loads),
        stalls=tuple(
            (column, f"recording {number}: {text}")
            for number, each in enumerate(logs, 1)
            for column, text in each.stalls
        ),
        runs=tuple(Run(float(each.time[0]), each.clocks) for each in parts),
    )


def _start_times_note(parts: Sequence[Log]) -> str:
    """Note on the start of each recording on the common time axis."""
    starts = ", ".join(f"{number} at {each.time[0]:.1f} s" for number, each in enumerate(parts[1:], 2))
    return (
        f"times run on through all recordings; number {starts} (where one recording is named, times are its "
        "own)"
    )


def _numbered_notes(logs: Sequence[Log]) -> list[str]:
    """Each distinct note with the numbers of its recordings."""
    numbers: dict[str, list[str]] = {}
    for number, log in enumerate(logs, 1):
        for note in log.notes:
            numbers.setdefault(note, []).append(str(number))
    return [f"recording{'s' * (len(of) > 1)} {', '.join(of)}: {note}" for note, of in numbers.items()]


def _dropped_channel_notes(logs: Sequence[Log], roles: Sequence[str]) -> list[str]:
    """Notes on channels that are dropped because some recordings lack them, with the numbers of these
    recordings: otherwise one recording of five could silently cost the gyro."""
    names = {each.role: each.name for log in logs for each in log.channels if each.role not in roles}
    told = []
    for role, name in names.items():
        without = [str(number) for number, log in enumerate(logs, 1) if log.channel(role) is None]
        which = f"recording{'s' * (len(without) > 1)} {', '.join(without)}"
        told.append(f"{which} lack{'s' * (len(without) == 1)} {name}, so it is left out of all")
    return told


def _missing_names(logs: Sequence[Log], roles: Sequence[str]) -> list[str]:
    """Names of channels that one of the recordings lacks, which are missing in the joined log."""
    dropped = [each.name for log in logs for each in log.channels if each.role not in roles]
    return [name for log in logs for name in log.missing] + dropped


def _channel(log: Log, role: str) -> Channel:
    return next(each for each in log.channels if each.role == role)


def _joined_channel(channels: Sequence[Channel]) -> Channel:
    return replace(channels[0], values=np.concatenate([each.values for each in channels]))


def _joined_brakes(logs: Sequence[Log]) -> NDArray[np.bool_] | None:
    """The joined `brake` of logs; None if none records it. The brake values of one log say nothing about
    another log, which has none if its robot never braked; there the stops decide."""
    if all(each.brake is None for each in logs):
        return None
    own = [
        np.full(each.duty.shape, motors_brake(each)) if each.brake is None else each.brake for each in logs
    ]
    return np.concatenate(own)


def _with_stop(log: Log) -> Log:
    """The log with a final row of duty 0, so that a recording that ends while it drives does not drive on in
    the pause."""
    end = 2.0 * log.time[-1] - log.time[-2]
    brake = None if log.brake is None else np.concatenate([log.brake, log.brake[-1:]])
    return replace(
        log,
        time=np.append(log.time, end),
        duty=np.concatenate([log.duty, np.zeros((1, 2))]),
        channels=tuple(replace(each, values=np.append(each.values, np.nan)) for each in log.channels),
        brake=brake,
    )


def _shifted(log: Log, by: float) -> Log:
    """The log on a time axis on which it is `by` s later."""

    def later(spans: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        return tuple((start + by, end + by) for start, end in spans)

    return replace(
        log,
        time=log.time + by,
        lost=later(log.lost),
        held=later(log.held),
        loads=tuple(replace(each, start=each.start + by, end=each.end + by) for each in log.loads),
        clocks=_shifted_clocks(log.clocks, by),
    )


def _shifted_clocks(clocks: Clocks, by: float) -> Clocks:
    left, right = (None if each is None else each.shifted(by) for each in clocks)
    return left, right
