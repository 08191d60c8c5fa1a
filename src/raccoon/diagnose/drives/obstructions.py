"""Detects stretches in which a robot did not drive freely: held by a wall or a hand, or lifted.

The simulated robot drives on a free floor. If the real one pushes against a wall, the effect would be taken
for friction, a deadband or a late reading; if it is lifted, its gyro does not match its wheels. Both are
detected from commands and readings alone, before anything is fitted, and left out.

Effects of faults must stay in, so each criterion is one that no fault meets: a load that comes to both wheels
almost at once while the command does not change, as large as that of rubbing tyres, and that ends with the
command; or a turn of the robot for half a second that its wheels do not show, though gyro and wheels agree
elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.bins import bin_indices, bin_means, describe_spans, runs_of_true, values_at_bins
from raccoon.diagnose.drives.log import MIN_DRIVE_S, Log
from raccoon.diagnose.drives.magnitudes import full_voltage
from raccoon.diagnose.drives.magnitudes import volts_per_unit as volts_of
from raccoon.diagnose.drives.slow_rows import MAX_ROW_S
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

BIN_S = 0.02
"""Width of the bins of commands and readings, s."""
MAX_BINNED_ROW_S = 1.25 * BIN_S  # to detect a hand; the onset of a load needs `MAX_ROW_S`
RESPONSE_TIME_CONSTANT_S = 0.055
"""Time constant, s, of a usual wheel together with its reading's filter."""
FREE_BEFORE_S, LOADED_AFTER_S = ((0.3, 0.06), (0.9, 0.6)), (0.2, 0.44)
"""Time before the onset of a load, s, (from, to) without it, for each way of contact; time after it with all
of it. At an angle to a wall a robot turns first, and its wheels get the load one by one."""
MIN_LOAD_SHARE = 0.06
"""Least load on both wheels, over the battery's voltage: 0.11 to 0.13 for a robot that spins its wheels at a
wall, 0.04 on a steep ramp."""
DRIVEN_SHARE = 0.2
"""Share of the battery's voltage above which a wheel is driven: below it, it may stick by itself."""
MAX_DUTY_CHANGE = 0.1
"""Largest change of duty before the onset of a load."""
REMAINING_LOAD_SHARE = 0.4
"""Share of the least load above which the load still acts."""
FIRST_LOAD_SHARE, READING_DELAY_S = 0.2, 0.1
"""Share of the least load above which a single wheel has it (a corner may touch a wall first and turn the
robot); and delay of the readings, s, by which the stretch begins earlier."""
MIN_TURN_MISMATCH = 0.5
"""Least difference of gyro and wheels, rad/s, of a lifted robot; also more than half of the larger rate."""
MIN_TURN_S = 0.4
"""Shortest such difference, s; a shorter one may be due to a filter's delay."""
AGREEMENT_RATE = 0.2
"""Difference, rad/s, within which gyro and wheels agree; and turn rate above which their scale shows."""
AGREEMENT_SHARE, CHANCE_S = 0.15, 0.2
"""Relative difference within which two turn rates agree; and longest agreement by chance, s."""
MAX_UNREAD_S = 0.15
"""Time without a sample of gyro or wheel, s, above which the turn is unknown."""
AGREEMENT_S = 0.3
"""Least time, s, for which gyro and wheels agree if the robot is on its wheels; so much of it next to a
stretch is left out too, since a hand may hold the robot already, or still."""
MERGE_GAP_S = 2.0
"""Time, s, between two stretches up to which they are merged: a robot in a hand is turned to and fro."""


@dataclass(frozen=True, slots=True)
class ObstructedStretch:
    """A stretch from `start` to `end`, s, in which a robot did not drive freely. why: HELD or LIFTED."""

    start: float
    end: float
    why: str


HELD, LIFTED = "held", "lifted"
_SENTENCES = {
    HELD: "both wheels fell behind a command that had not changed: held by a wall, or switched off?",
    LIFTED: "the robot turned as no wheel did: lifted, or held by a wall?",
}


def leave_out_obstructed(log: Log, found: Sequence[ObstructedStretch]) -> Log:
    """The log with these stretches marked as lost, and notes on them; the same log without any. Raises
    TraceError if too little remains."""
    if not found:
        return log
    by_reason = ([each for each in found if each.why == why] for why in (HELD, LIFTED))
    told = tuple(_describe_stretches(each) for each in by_reason if each)
    free = log.without_spans(spans_of(found))
    if free is None:
        raise TraceError(f"{'; '.join(told)}; a diagnosis needs at least {MIN_DRIVE_S:g} s of driving freely")
    return replace(free, notes=(*log.notes, *told))


def _describe_stretches(stretches: Sequence[ObstructedStretch]) -> str:
    """Note on stretches that have the same reason."""
    spans, sentence = describe_spans(spans_of(stretches)), _SENTENCES[stretches[0].why]
    return f"{spans} {sentence} Left out, since the simulated robot drives freely"


def without_held_readings(log: Log) -> Log:
    """The log without readings from the spans in which the robot did not drive freely."""
    if not log.held:
        return log
    out = np.zeros(len(log.time), bool)
    for start, end in log.held:
        out |= (log.time >= start) & (log.time <= end)
    channels = tuple(replace(each, values=np.where(out, np.nan, each.values)) for each in log.channels)
    return replace(log, channels=channels)


def find_held_spans(log: Log, robot: RobotConfig) -> tuple[tuple[float, float], ...]:
    """Spans (start, end), s, in which the robot did not drive freely; none if time does not advance."""
    if len(log.time) < 2 or not bool((np.diff(log.time) > 0.0).all()):
        return ()
    return spans_of(find_obstructed_stretches(log, robot))


def spans_of(found: Sequence[ObstructedStretch]) -> tuple[tuple[float, float], ...]:
    """Span (start, end) of each stretch, s."""
    return tuple((each.start, each.end) for each in found)


def find_obstructed_stretches(log: Log, robot: RobotConfig) -> tuple[ObstructedStretch, ...]:
    """The stretches in which the robot did not drive freely, in time order."""
    seen = _BinnedDrive.of(log, robot)
    if seen is None:
        return ()
    ways = FREE_BEFORE_S if median_step(log.time) <= MAX_ROW_S else ()
    held = [each for before in ways for each in _as_stretches(seen, _loaded_bins(seen, before), HELD)]
    return _merged([*_as_stretches(seen, _lifted_bins(seen), LIFTED), *held])


@dataclass(frozen=True, slots=True)
class _BinnedDrive:
    """A log in even bins. time (n,): their starts, s. duty (2, n): each wheel's command. volts (2, n): the
    command's voltage behind a usual wheel's response, V. speed (2, n): each wheel's back-EMF, V. gyro, wheels
    (n,): turn rate by each, rad/s, NaN without it. full: the battery's voltage, V."""

    time: Array
    duty: Array
    volts: Array
    speed: Array
    gyro: Array
    wheels: Array
    full: float

    @classmethod
    def of(cls, log: Log, robot: RobotConfig) -> _BinnedDrive | None:
        """The bins of a log; None without both wheels or without commands, if too short or with rows too
        long."""
        left, right = (log.wheel(side) for side in ("left", "right"))
        short = log.seconds < MIN_DRIVE_S or median_step(log.time) > MAX_BINNED_ROW_S
        if left is None or right is None or short or not log.duty.any():
            return None
        model, battery, gyro = robot.model, log.channel("battery"), log.channel("gyro")
        full = full_voltage(log, robot)
        time = np.arange(log.time[0], log.time[-1], BIN_S)
        keep = np.exp(
            -BIN_S / RESPONSE_TIME_CONSTANT_S * np.arange(round(8 * RESPONSE_TIME_CONSTANT_S / BIN_S))
        )
        duty = np.stack([values_at_bins(log.time, each, time, BIN_S) for each in log.duty.T])
        supply = np.full(len(time), full)
        if battery is not None:
            # With a loose plug the wheels slow down with the battery's voltage.
            supply = _smooth(_bin_means(log.time, battery.values, time))
        volts = np.stack([np.convolve(each, keep / keep.sum())[: len(time)] for each in supply * duty])
        motors = (model.left, model.right)
        constants = [each.back_emf_constant.value for each in motors]
        speed = np.stack(
            [
                volts_of(each, motor) * _bin_means(log.time, each.values, time)
                for each, motor in zip((left, right), motors, strict=True)
            ]
        )
        turn = speed[1] / constants[1] - speed[0] / constants[0]
        turn *= model.drive.wheel_radius.value / model.drive.track_width.value
        rate = np.full(len(time), np.nan) if gyro is None else _bin_means(log.time, gyro.values, time)
        for each in (left, right, *(() if gyro is None else (gyro,))):
            blank = _unread_bins(log.time, each.values, time)
            rate[blank] = turn[blank] = 0.0
        return cls(time, duty, volts, speed, _smooth(rate), _smooth(turn), full)


def _bin_means(at: Array, values: Array, time: Array) -> Array:
    """Means of the samples in each bin, interpolated over empty bins; NaN if there are no samples at all."""
    means = bin_means(bin_indices(at, time), values, len(time))
    filled = np.isfinite(means)
    return np.interp(time, time[filled], means[filled]) if filled.any() else means


def _unread_bins(at: Array, values: Array, time: Array) -> Flags:
    """The bins in stretches without samples: an interpolated rate does not show how the robot turned in
    them."""
    known = np.concatenate([[time[0]], at[np.isfinite(values)], [time[-1] + BIN_S]])
    after = np.clip(np.searchsorted(known, time + 0.5 * BIN_S), 1, len(known) - 1)
    return np.asarray(known[after] - known[after - 1] > MAX_UNREAD_S)


def _smooth(values: Array) -> Array:
    """Moving average over 0.1 s."""
    return np.asarray(np.convolve(np.pad(values, 2, mode="edge"), np.full(5, 0.2), mode="valid"), float)


def _lifted_bins(seen: _BinnedDrive) -> Flags:
    """The bins in which the robot turned as its wheels did not; none if gyro and wheels never agree, which is
    another fault (another gyro axis, an unplugged wheel)."""
    nothing = np.zeros(len(seen.time), bool)
    if not np.isfinite(seen.gyro + seen.wheels).all():
        return nothing
    scale, agreeing = _gyro_scale(seen)
    expected = scale * seen.wheels
    off = np.abs(seen.gyro - expected)
    most = np.maximum(np.abs(seen.gyro), np.abs(expected))
    far = (off > MIN_TURN_MISMATCH) & (off > 0.5 * most)
    if agreeing * BIN_S < MIN_TURN_S and (np.abs(expected) > AGREEMENT_RATE).any():
        return nothing
    found, around = nothing.copy(), round(AGREEMENT_S / BIN_S)
    near = nothing.copy()
    for start, end in runs_of_true(off < AGREEMENT_RATE):
        near[start:end] = end - start >= around
    for start, end in runs_of_true(far):
        if (end - start) * BIN_S < MIN_TURN_S:
            continue
        back = np.flatnonzero(near[:start])
        ahead = np.flatnonzero(near[end:])
        first = back[-1] + 1 - around if len(back) else 0
        found[max(first, 0) : end + ahead[0] + around if len(ahead) else len(found)] = True
    return found


def _gyro_scale(seen: _BinnedDrive) -> tuple[float, int]:
    """The factor on the turn rate by the wheels with which the gyro agrees for longest while they turn the
    robot, and that time in bins. Agreement of less than CHANCE_S does not count."""
    best = (1.0, 0)
    for factor in np.linspace(0.6, 1.6, 51):
        expected = factor * seen.wheels
        near = (np.abs(expected) > AGREEMENT_RATE) & (
            np.abs(seen.gyro - expected) < AGREEMENT_SHARE * np.abs(expected)
        )
        lengths = [end - start for start, end in runs_of_true(near) if (end - start) * BIN_S >= CHANCE_S]
        if sum(lengths) > best[1]:
            best = float(factor), sum(lengths)
    return best


def _loaded_bins(seen: _BinnedDrive, free_for: tuple[float, float]) -> Flags:
    """The bins in which both wheels carry a load without a new command. free_for: as in FREE_BEFORE_S."""
    found = np.zeros(len(seen.time), bool)
    way = np.sign(seen.volts)
    load = way * (seen.volts - seen.speed)
    driven = np.abs(seen.volts) > DRIVEN_SHARE * seen.full
    reach, near, least, most = (round(each / BIN_S) for each in (*free_for, *LOADED_AFTER_S))
    done = 0
    for row in range(reach, len(found) - most):
        if row < done:
            continue
        whole = slice(row - reach, row + most)
        if not driven[:, whole].all() or np.any(way[:, whole] != way[:, row, None]):
            continue
        if np.ptp(seen.duty[:, row - reach : row + 1], axis=1).max() > MAX_DUTY_CHANGE:
            continue
        before = load[:, row - reach : row - near].max(axis=1)
        jump = load[:, row + least : row + most].min(axis=1) - before
        if jump.min() < MIN_LOAD_SHARE * seen.full:
            continue
        level = before + REMAINING_LOAD_SHARE * MIN_LOAD_SHARE * seen.full
        there = driven & (way == way[:, row, None]) & (load > level[:, None])
        first = row + int(np.argmax(there[:, row:].all(axis=0)))
        gone = np.flatnonzero(~there[:, first:].all(axis=0))
        done = first + int(gone[0]) if len(gone) else len(found)
        free = load[:, row - reach : row].min(axis=1) + FIRST_LOAD_SHARE * MIN_LOAD_SHARE * seen.full
        alone = np.flatnonzero(~(load[:, :first] > free[:, None]).any(axis=0))
        found[max((alone[-1] if len(alone) else 0) - round(READING_DELAY_S / BIN_S), 0) : done] = True
    return found


def _as_stretches(seen: _BinnedDrive, flags: Flags, why: str) -> list[ObstructedStretch]:
    time = np.append(seen.time, seen.time[-1] + BIN_S)
    return [
        ObstructedStretch(float(time[start]), float(time[end]), why) for start, end in runs_of_true(flags)
    ]


def _merged(stretches: Sequence[ObstructedStretch]) -> tuple[ObstructedStretch, ...]:
    """The stretches in time order; overlapping or near ones merged, with the reason of the longer one."""
    found: list[ObstructedStretch] = []
    for each in sorted(stretches, key=lambda one: one.start):
        if not found or each.start - found[-1].end > MERGE_GAP_S:
            found.append(each)
            continue
        last = found.pop()
        longer = max(last, each, key=lambda one: one.end - one.start)
        found.append(ObstructedStretch(last.start, max(last.end, each.end), longer.why))
    return tuple(found)
