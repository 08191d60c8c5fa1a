"""Averages over short bins: the features in which a recording and a simulation are compared.

Measured and simulated samples pass the same linear map, so information that the map loses is lost on both
sides. If the commands oscillate (`excitation.swing_period`), a bin is one period: the commands respond to a
disturbance sooner than the wheels' filtered readings show it, and within a period that looks like different
wheels. If a loop controls the wheels' speeds, a bin is no longer than the loop's response time to a reading
(`bin_width`).
"""

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
"""Default width of a bin, s, and its lower bound (a usual controller's cycle) for drives with a closed
loop."""
EVENT_S = 0.5
"""Time, s, within which everything that happens counts as one event: the error of a wheel that breaks loose
late is over by then."""
SETTLING_S = 0.3
"""Time at the start, s, that is not compared: the initial state is unknown, and forgotten after this time."""


def bins_per_event(width: float) -> int:
    """Number of bins of this width (s) in an event of half a second, at least 1."""
    return max(round(EVENT_S / width), 1)


def bin_width(log: Log) -> float:
    """Width of a bin, s, at most `BIN_S`, in which no command responds to a reading of the same bin.

    The mean over a bin that holds both correlates the response with the noise of its reading, so noise looks
    like an effect of the commands: all fault-free robots that drove 1.5 m there and back under the wheel
    speed loop were reported a latency of 4 ms, and none with bins of one cycle. The width is the median,
    weighted by duration, of the intervals between command changes while driving, which is long in open loop;
    at least `MIN_BIN_S`.
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
    """The linear map of one channel, (bins, samples): means of the samples in each bin, interpolated over
    empty bins."""
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
    """A channel's samples, 0 for missing ones; for back-EMF with the truncation to whole counts undone."""
    values = np.nan_to_num(channel.values)
    return undo_truncation(values) if channel.role.startswith("bemf") else values


def _is_left_out(log: Log, time: Array, reach: float) -> NDArray[np.bool_]:
    """Which times (s) are within `reach` (s) of a lost span or of another load on the battery."""
    lost = np.zeros(len(time), bool)
    for start, end in (*log.lost, *((each.start, each.end) for each in log.loads)):
        lost |= (time > start - reach) & (time < end + reach)
    return lost


def _known_channels(log: Log) -> tuple[Channel, ...]:
    """The channels without readings in lost spans: interpolation over a gap must not end at a reading of a
    robot that has not settled yet."""
    if not (log.lost or log.loads):
        return log.channels
    lost = _is_left_out(log, log.time, 0.0)
    return tuple(replace(each, values=np.where(lost, np.nan, each.values)) for each in log.channels)


def without_empty_channels(log: Log) -> Log:
    """The log without channels that have too few readings in the compared time, and a note on them; the same
    log if there are none."""
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
    """The bins of a log. roles: of the channels, in their order. floors: of the channels. time (bins,):
    centres of the bins, s. measured (bins, channels). maps: of each channel, (bins, samples). width: of a
    bin, s. driven (bins, 2): whether each wheel was commanded, left before right. starts: s, of the
    recordings after the first in a joined log."""

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
        """Bins of this width (s) from the time at which the initial state is forgotten to the end, without
        lost spans and spans with other loads."""
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
        """`of`, computed once in the lifetime of the log: a diagnosis needs it for each controller habit."""
        made = _CACHE.setdefault(log, {})
        if width not in made:
            made[width] = cls.of(log, width)
        return made[width]

    @property
    def event(self) -> int:
        """Number of bins in half a second."""
        return bins_per_event(self.width)

    def simulated(self, channels: Array) -> Array:
        """Bins (lanes, bins, channels) of simulated samples (lanes, channels, samples)."""
        binned = np.empty((len(channels), len(self.time), len(self.maps)))
        for index, bins in enumerate(self.maps):
            binned[..., index] = (bins @ channels[:, index].T).T
        return binned


_CACHE: WeakKeyDictionary[Log, dict[float, Features]] = WeakKeyDictionary()
"""Features by log and width (s). They hold no reference to the log, so they are freed with it."""
