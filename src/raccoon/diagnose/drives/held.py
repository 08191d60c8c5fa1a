"""Stretches in which a robot did not drive freely: a wall or a hand held it, or it was lifted.

The simulated robot drives on a free floor. Where the real one pushed against a wall, what the wall did would
be taken for friction, a deadband or a late reading, and where it was picked up its gyro says nothing of its
wheels. Both are found from commands and readings alone, before anything is fitted, and left out.

What a fault does must stay in. So each sign is one that no fault has: a load that comes to both wheels within
a moment in which the command says nothing new, is as large as tyres that rub, and goes with the command; and
a robot that turns, for half a second, as no wheel does, though its gyro and its wheels agree elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.binned import bin_means, in_force, placed, runs, when
from raccoon.diagnose.drives.log import SHORTEST_SECONDS, Log
from raccoon.diagnose.drives.sizes import full_voltage
from raccoon.diagnose.drives.sizes import volts as volts_of
from raccoon.diagnose.drives.slow_rows import SLOWEST_ROW
from raccoon.trace.recording import usual_step

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

BIN = 0.02
"""s over which commands and readings are averaged."""
LONGEST_ROW = 1.25 * BIN  # s, in which a hand is seen; when a load came, rows up to `SLOWEST_ROW` tell
FOLLOWS = 0.055
"""s by which a usual wheel and its reading's filter follow a command, together."""
BEFORE, AFTER = ((0.3, 0.06), (0.9, 0.6)), (0.2, 0.44)
"""s before a load comes and after it, in which it is not there yet, and all of it. At an angle to a wall a
robot turns first, and its wheels carry the load one after the other."""
LOAD = 0.06
"""Of the battery's voltage, which a load must take of both wheels: a robot that spins its wheels at a wall
loses 0.11 to 0.13 of it, one that drives up a steep ramp 0.04."""
DRIVEN = 0.2
"""Of the battery's voltage that drives a wheel: one that creeps with less may stick by itself."""
SAME = 0.1
"""Of duty, by which a command may change before a load comes."""
LEFT = 0.4
"""Part of a load with which it is still there."""
TOUCHES, SOONER = 0.2, 0.1
"""Part of a load from which one wheel has it, as where a corner touches a wall first and turns the robot; and
s before, since readings are behind."""
TURNS = 0.5
"""rad/s and more by which a robot turns that turns as no wheel does, and as none does by more than half."""
LASTS = 0.4
"""s for which it does, at least. In less a filter may be behind."""
AGREES = 0.2
"""rad/s within which gyro and wheels agree, and from which their scale is seen."""
ALIKE, MOMENT = 0.15, 0.2
"""Of a turn, by which two readings of it may differ that agree; and s for which they do so by chance."""
UNREAD = 0.15
"""s without a sample of a gyro or a wheel in which nobody knows how it turned."""
AROUND = 0.3
"""s for which gyro and wheels agree where a robot is on its wheels again; and before and after it, in which
it may be in the hand that turns it already, or still."""
ONCE = 2.0
"""s between two such stretches that are one: a robot in a hand is turned to and fro."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """From when to when, in s, a robot did not drive freely, and what that was."""

    start: float
    end: float
    why: str


HELD, LIFTED = "held", "lifted"
_SAYS = {
    HELD: "both wheels fell behind a command that had not changed: held by a wall, or switched off?",
    LIFTED: "the robot turned as no wheel did: lifted, or held by a wall?",
}


def with_free_driving(log: Log, found: Sequence[Stretch]) -> Log:
    """The log with what was not driven freely, as `not_free` has it, among what is lost, and a note of it;
    the same log where there is nothing of that kind.

    Raises TraceError where too little is left.
    """
    if not found:
        return log
    told = tuple(_told(why, [each for each in found if each.why == why]) for why in (HELD, LIFTED))
    told = tuple(each for each in told if each)
    free = log.without(spans(found))
    if free is None:
        raise TraceError(
            f"{'; '.join(told)}; a diagnosis needs at least {SHORTEST_SECONDS:g} s of driving freely"
        )
    return replace(free, notes=(*log.notes, *told))


def _told(why: str, stretches: Sequence[Stretch]) -> str:
    if not stretches:
        return ""
    return f"{when(spans(stretches))} {_SAYS[why]} Left out, since the simulated robot drives freely"


def of_free_driving(log: Log) -> Log:
    """The log without the readings of a robot that did not drive freely."""
    if not log.held:
        return log
    out = np.zeros(len(log.time), bool)
    for start, end in log.held:
        out |= (log.time >= start) & (log.time <= end)
    channels = tuple(replace(each, values=np.where(out, np.nan, each.values)) for each in log.channels)
    return replace(log, channels=channels)


def where_held(log: Log, robot: RobotConfig) -> tuple[tuple[float, float], ...]:
    """s, from and to, in which a robot did not drive freely; none where the time does not advance."""
    if len(log.time) < 2 or not bool((np.diff(log.time) > 0.0).all()):
        return ()
    return spans(not_free(log, robot))


def spans(found: Sequence[Stretch]) -> tuple[tuple[float, float], ...]:
    """s, from and to, of each."""
    return tuple((each.start, each.end) for each in found)


def not_free(log: Log, robot: RobotConfig) -> tuple[Stretch, ...]:
    """The stretches in which a robot did not drive freely, in the order of time."""
    seen = _Seen.of(log, robot)
    if seen is None:
        return ()
    ways = BEFORE if usual_step(log.time) <= SLOWEST_ROW else ()
    held = [each for before in ways for each in _as_stretches(seen, _loaded(seen, before), HELD)]
    return _united([*_as_stretches(seen, _turned(seen), LIFTED), *held])


@dataclass(frozen=True, slots=True)
class _Seen:
    """A log in even bins. time (n,) s: their starts. duty (2, n): each wheel's command; volts (2, n): as far
    as it has come through to the reading; speed (2, n): V of its back-EMF. gyro, wheels (n,) rad/s: what each
    says of turning; NaN without one. full: V of the battery."""

    time: Array
    duty: Array
    volts: Array
    speed: Array
    gyro: Array
    wheels: Array
    full: float

    @classmethod
    def of(cls, log: Log, robot: RobotConfig) -> _Seen | None:
        """The bins of a log, None without both wheels or where nothing was commanded."""
        left, right = (log.wheel(side) for side in ("left", "right"))
        short = log.seconds < SHORTEST_SECONDS or usual_step(log.time) > LONGEST_ROW
        if left is None or right is None or short or not log.duty.any():
            return None
        model, battery, gyro = robot.model, log.channel("battery"), log.channel("gyro")
        full = full_voltage(log, robot)
        time = np.arange(log.time[0], log.time[-1], BIN)
        keep = np.exp(-BIN / FOLLOWS * np.arange(round(8 * FOLLOWS / BIN)))
        duty = np.stack([in_force(log.time, each, time, BIN) for each in log.duty.T])
        supply = np.full(len(time), full)
        if battery is not None:
            # Where a plug is loose wheels slow down with the battery.
            supply = _smooth(_mean(log.time, battery.values, time))
        volts = np.stack([np.convolve(each, keep / keep.sum())[: len(time)] for each in supply * duty])
        motors = (model.left, model.right)
        constants = [each.back_emf_constant.value for each in motors]
        speed = np.stack(
            [
                volts_of(each, motor) * _mean(log.time, each.values, time)
                for each, motor in zip((left, right), motors, strict=True)
            ]
        )
        turn = speed[1] / constants[1] - speed[0] / constants[0]
        turn *= model.drive.wheel_radius.value / model.drive.track_width.value
        rate = np.full(len(time), np.nan) if gyro is None else _mean(log.time, gyro.values, time)
        for each in (left, right, *(() if gyro is None else (gyro,))):
            blank = _unread(log.time, each.values, time)
            rate[blank] = turn[blank] = 0.0
        return cls(time, duty, volts, speed, _smooth(rate), _smooth(turn), full)


def _mean(at: Array, values: Array, time: Array) -> Array:
    """Means of the samples in each bin, lines over empty ones; NaN where there are no samples at all."""
    means = bin_means(placed(at, time), values, len(time))
    filled = np.isfinite(means)
    return np.interp(time, time[filled], means[filled]) if filled.any() else means


def _unread(at: Array, values: Array, time: Array) -> Flags:
    """Bins in a stretch without samples in which a robot may have turned: what a line over it says of turning
    is nobody's."""
    known = np.concatenate([[time[0]], at[np.isfinite(values)], [time[-1] + BIN]])
    after = np.clip(np.searchsorted(known, time + 0.5 * BIN), 1, len(known) - 1)
    return np.asarray(known[after] - known[after - 1] > UNREAD)


def _smooth(values: Array) -> Array:
    """Means over 0.1 s."""
    return np.asarray(np.convolve(np.pad(values, 2, mode="edge"), np.full(5, 0.2), mode="valid"), float)


def _turned(seen: _Seen) -> Flags:
    """Where the robot turned as no wheel did. Where they never agree something else is wrong: another axis, a
    wheel without a plug."""
    nothing = np.zeros(len(seen.time), bool)
    if not np.isfinite(seen.gyro + seen.wheels).all():
        return nothing
    scale, agreeing = _scale(seen)
    expected = scale * seen.wheels
    off = np.abs(seen.gyro - expected)
    most = np.maximum(np.abs(seen.gyro), np.abs(expected))
    far = (off > TURNS) & (off > 0.5 * most)
    if agreeing * BIN < LASTS and (np.abs(expected) > AGREES).any():
        return nothing
    found, around = nothing.copy(), round(AROUND / BIN)
    near = nothing.copy()
    for start, end in runs(off < AGREES):
        near[start:end] = end - start >= around
    for start, end in runs(far):
        if (end - start) * BIN < LASTS:
            continue
        back = np.flatnonzero(near[:start])
        ahead = np.flatnonzero(near[end:])
        first = back[-1] + 1 - around if len(back) else 0
        found[max(first, 0) : end + ahead[0] + around if len(ahead) else len(found)] = True
    return found


def _scale(seen: _Seen) -> tuple[float, int]:
    """The factor of what the wheels say of turning with which the gyro agrees for longest, and for how long,
    in bins, while they turn the robot. A moment is chance."""
    best = (1.0, 0)
    for factor in np.linspace(0.6, 1.6, 51):
        expected = factor * seen.wheels
        near = (np.abs(expected) > AGREES) & (np.abs(seen.gyro - expected) < ALIKE * np.abs(expected))
        lengths = [end - start for start, end in runs(near) if (end - start) * BIN >= MOMENT]
        if sum(lengths) > best[1]:
            best = float(factor), sum(lengths)
    return best


def _loaded(seen: _Seen, free_for: tuple[float, float]) -> Flags:
    """Where both wheels carry a load that came without a command, and was not there for that time before."""
    found = np.zeros(len(seen.time), bool)
    way = np.sign(seen.volts)
    load = way * (seen.volts - seen.speed)
    driven = np.abs(seen.volts) > DRIVEN * seen.full
    reach, near, least, most = (round(each / BIN) for each in (*free_for, *AFTER))
    done = 0
    for row in range(reach, len(found) - most):
        if row < done:
            continue
        whole = slice(row - reach, row + most)
        if not driven[:, whole].all() or np.any(way[:, whole] != way[:, row, None]):
            continue
        if np.ptp(seen.duty[:, row - reach : row + 1], axis=1).max() > SAME:
            continue
        before = load[:, row - reach : row - near].max(axis=1)
        jump = load[:, row + least : row + most].min(axis=1) - before
        if jump.min() < LOAD * seen.full:
            continue
        level = before + LEFT * LOAD * seen.full
        there = driven & (way == way[:, row, None]) & (load > level[:, None])
        first = row + int(np.argmax(there[:, row:].all(axis=0)))
        gone = np.flatnonzero(~there[:, first:].all(axis=0))
        done = first + int(gone[0]) if len(gone) else len(found)
        free = load[:, row - reach : row].min(axis=1) + TOUCHES * LOAD * seen.full
        alone = np.flatnonzero(~(load[:, :first] > free[:, None]).any(axis=0))
        found[max((alone[-1] if len(alone) else 0) - round(SOONER / BIN), 0) : done] = True
    return found


def _as_stretches(seen: _Seen, flags: Flags, why: str) -> list[Stretch]:
    time = np.append(seen.time, seen.time[-1] + BIN)
    return [Stretch(float(time[start]), float(time[end]), why) for start, end in runs(flags)]


def _united(stretches: Sequence[Stretch]) -> tuple[Stretch, ...]:
    """In the order of time; those that overlap or are near to each other as one, named after the longer."""
    found: list[Stretch] = []
    for each in sorted(stretches, key=lambda one: one.start):
        if not found or each.start - found[-1].end > ONCE:
            found.append(each)
            continue
        last = found.pop()
        longer = max(last, each, key=lambda one: one.end - one.start)
        found.append(Stretch(last.start, max(last.end, each.end), longer.why))
    return tuple(found)
