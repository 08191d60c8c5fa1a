"""Averages over short bins: what of a recording is compared, and the same of a simulation.

Measured and simulated samples pass the same linear map, so what the map loses is lost on both sides. Where
commands swing (`excitation.swing_period`) a bin is a whole swing: commands answer what disturbs the robot
sooner than the wheels' filtered readings show it, and within a swing that looks like other wheels. Where a
loop holds the wheels' speeds a bin is no longer than the loop takes to answer a reading (`bin_width`)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from raccoon.diagnose.drives.bins import values_at_bins
from raccoon.diagnose.drives.log import MIN_READINGS, Channel, Log
from raccoon.diagnose.drives.truncation import undo_truncation

Array = NDArray[np.float64]

BIN_S, MIN_BIN_S = 0.02, 0.005
"""s over which readings are averaged before they are compared; where a loop answers its readings, down to a
usual controller's cycle."""
EVENT_S = 0.5
"""s in which all that happens counts as one event: what a wheel that breaks loose late is off by is over."""
SETTLING_S = 0.3
"""s at the start that are not compared: what the robot did before is not known, and forgotten by then."""


def bins_per_event(width: float) -> int:
    """How many bins of that width, s, are half a second, 1 or more."""
    return max(round(EVENT_S / width), 1)


def bin_width(log: Log) -> float:
    """s of a bin, `BIN_S` or less, within which no command answers what a reading of the same bin is off by.

    Means of a bin hold such an answer and its reading's noise together, so noise looks as if it were what the
    commands did: of sound robots that drove 1.5 m there and back with the wheel loop, all had a latency of
    4 ms, with bins of a cycle none. It is the time between two changes of the commands in which most of the
    driving passes, which is long where no loop is closed.
    """
    driven = np.asarray(log.duty.any(axis=1))
    changed = np.flatnonzero((np.diff(log.duty, axis=0) != 0.0).any(axis=1)) + 1
    edges = np.concatenate([[0], changed, [len(log.time) - 1]])
    gaps = np.diff(log.time[edges])
    gaps = np.sort(gaps[driven[edges[:-1]]])
    if len(gaps) == 0:
        return BIN_S
    passed = np.cumsum(gaps)
    usual = float(gaps[np.searchsorted(passed, 0.5 * passed[-1])])
    return min(max(usual, MIN_BIN_S), BIN_S)


def _bin_map(channel: Channel, position: NDArray[np.intp], count: int) -> csr_array:
    """The map of one channel, (bins, samples): means of the samples in each bin, lines over empty ones."""
    samples = np.flatnonzero(np.isfinite(channel.values) & (position >= 0) & (position < count))
    filled, row, sizes = np.unique(position[samples], return_inverse=True, return_counts=True)
    shape = len(filled), len(channel.values)
    means = csr_array((1.0 / sizes[row], (row, samples)), shape=shape)
    grid = np.arange(count)
    after = np.clip(np.searchsorted(filled, grid), 0, len(filled) - 1)
    before = np.clip(np.where(filled[after] == grid, after, after - 1), 0, len(filled) - 1)
    width = np.maximum(filled[after] - filled[before], 1)
    share = np.clip((grid - filled[before]) / width, 0.0, 1.0)
    weights = np.concatenate([1.0 - share, share])
    bridges = csr_array((weights, (np.tile(grid, 2), np.concatenate([before, after]))), (count, len(filled)))
    whole = csr_array(bridges @ means)
    whole.eliminate_zeros()
    return whole


def _without_truncation(channel: Channel) -> Array:
    """A channel's samples, 0 where there is none; back-EMF as it was before it was cut off."""
    values = np.nan_to_num(channel.values)
    return undo_truncation(values) if channel.role.startswith("bemf") else values


def _is_left_out(log: Log, time: Array, reach: float) -> NDArray[np.bool_]:
    """Which times, s, are nearer than reach to what the log has lost, or to what other loads act in."""
    lost = np.zeros(len(time), bool)
    for start, end in (*log.lost, *((each.start, each.end) for each in log.loads)):
        lost |= (time > start - reach) & (time < end + reach)
    return lost


def _known_channels(log: Log) -> tuple[Channel, ...]:
    """The channels without readings of what is lost: a line from the last one before a gap must not end at
    one of a robot that has not settled yet."""
    if not (log.lost or log.loads):
        return log.channels
    lost = _is_left_out(log, log.time, 0.0)
    return tuple(replace(each, values=np.where(lost, np.nan, each.values)) for each in log.channels)


def without_empty_channels(log: Log) -> Log:
    """The log without channels of which too few readings are left where anything is compared, and a note of
    them; the same log where there are none."""
    compared = log.time >= log.time[0] + SETTLING_S
    seen = {each.role: int(np.isfinite(each.values[compared]).sum()) for each in _known_channels(log)}
    gone = [each.name for each in log.channels if seen[each.role] < MIN_READINGS]
    if not gone:
        return log
    kept = tuple(each for each in log.channels if each.name not in gone)
    note = f"{' and '.join(gone)}: next to no readings are left of what is compared, so left out"
    return replace(log, channels=kept, missing=(*log.missing, *gone), notes=(*log.notes, note))


@dataclass(frozen=True, slots=True)
class Features:
    """The bins of a log. roles: the channels in their order. time (bins,) s: the bins' centres. width: s
    of a bin. driven (bins, 2): whether each wheel was commanded to go, left before right. starts: s, of the
    recordings after the first that are in it."""

    roles: tuple[str, ...]
    floors: Array
    time: Array
    measured: Array
    maps: tuple[csr_array, ...]
    width: float
    driven: NDArray[np.bool_]
    starts: tuple[float, ...] = ()

    @classmethod
    def of(cls, log: Log, width: float = BIN_S) -> Features:
        """Bins of that width, s, from the settling of the unknown start state to the end, less what is
        lost and what other loads act in."""
        start = log.time[0] + SETTLING_S
        count = max(int((log.time[-1] - start) / width), 1)
        position = np.floor((log.time - start) / width).astype(np.intp)
        time = start + width * (np.arange(count) + 0.5)
        maps = tuple(_bin_map(each, position, count) for each in _known_channels(log))
        driven = values_at_bins(log.time, log.duty, time, 0.0) != 0.0
        if log.lost or log.loads:
            kept = np.flatnonzero(~_is_left_out(log, time, width / 2))
            time, driven = time[kept], driven[kept]
            maps = tuple(csr_array(each[kept]) for each in maps)
        measured = np.column_stack(
            [bins @ _without_truncation(each) for bins, each in zip(maps, log.channels, strict=True)]
        )
        return cls(
            tuple(each.role for each in log.channels),
            np.array([each.floor for each in log.channels]),
            time,
            measured,
            maps,
            width,
            driven,
            tuple(each.start for each in log.runs[1:]),
        )

    @classmethod
    def cached(cls, log: Log, width: float) -> Features:
        """The same, made once while the log lives: a diagnosis asks under each of a controller's habits."""
        made = _CACHE.setdefault(log, {})
        if width not in made:
            made[width] = cls.of(log, width)
        return made[width]

    @property
    def event(self) -> int:
        """Bins of half a second."""
        return bins_per_event(self.width)

    def simulated(self, channels: Array) -> Array:
        """Simulated samples (lanes, channels, samples) to bins (lanes, bins, channels)."""
        binned = np.empty((len(channels), len(self.time), len(self.maps)))
        for index, bins in enumerate(self.maps):
            binned[..., index] = (bins @ channels[:, index].T).T
        return binned


_CACHE: WeakKeyDictionary[Log, dict[float, Features]] = WeakKeyDictionary()
"""By log and width; they hold nothing of the log, so they go with it."""
