"""Detects wheels that stand still although they are driven: unplugged or switched-off motors, or a jam.

No parameter of a robot makes a wheel stand still at nearly a fifth of the battery's voltage. Such stalls are
left out as stretches that were not driven freely, and reported with the current that the battery's voltage
shows: a stalled motor draws its largest current, an unplugged one none.
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
from raccoon.diagnose.drives.magnitudes import full_voltage, volts_per_unit

Array = NDArray[np.float64]
SIDES = ("left", "right")

BIN_S = 0.02
"""Width of the bins of commands and readings, s."""
DRIVEN_SHARE = 0.18
"""Share of the battery's voltage above which a wheel is clearly driven."""
MAX_STALLED_SHARE, MIN_FOLLOWING_SHARE = 0.1, 0.5
"""Back-EMF of a wheel over its command's voltage, up to which it stands still and above which it follows."""
MIN_STALL_S, MIN_FOLLOWING_S = 0.4, 0.1
"""Shortest stall, s, and shortest time of following the command that ends it, s."""
BEFORE_STALL_S, MAX_SLOWED_SHARE = 1.0, 0.9
"""Time before a stall, s, whose median ratio of back-EMF to command is the wheel's usual one; and share of
that ratio below which the wheel is already slowing down."""
MIN_STALL_SAG_V = 0.015
"""Least sag that stalled motors would cause, V, for a decision on their current by the battery's reading."""
MAX_NO_CURRENT_SHARE, MIN_CURRENT_SHARE = 0.25, 0.5
"""Share of this sag up to which the motors draw no current, and above which they do."""
BATTERY_DELAY_S = 0.3
"""Delay of a battery's reading, s."""


@dataclass(frozen=True, slots=True)
class Stall:
    """A stall. start, end: s. sides: the wheels that stood still. current: whether they drew current, None if
    unknown."""

    start: float
    end: float
    sides: tuple[str, ...]
    current: bool | None = None


def leave_out_stalls(log: Log, robot: RobotConfig) -> Log:
    """The log with stalls marked as lost and described in `stalls`; the same log if there are none.

    Raises TraceError if too little remains.
    """
    known, seen = log.held, find_stalls(log, robot)
    if not seen:
        return log
    found = [each for each in seen if not any(_covers(span, each) for span in known)]
    # Spans that are left out already are only reported if the battery shows something about the current.
    news = [each for each in seen if each in found or each.current is not None]
    told = describe_stalls(news, robot)
    log = replace(log, stalls=told)
    if not found:
        return log
    free = log.without_spans([(each.start, each.end) for each in found])
    if free is None:
        raise TraceError(
            f"{'; '.join(text for _, text in told)}; a diagnosis needs at least {MIN_DRIVE_S:g} s of "
            "driving freely"
        )
    return free


def _covers(span: tuple[float, float], found: Stall) -> bool:
    shared = min(span[1], found.end) - max(span[0], found.start)
    return shared > 0.5 * (found.end - found.start)


def describe_stalls(found: Sequence[Stall], robot: RobotConfig) -> tuple[tuple[str, str], ...]:
    """A column and a sentence, without a full stop, for each kind of stall (its wheels, and whether they drew
    current)."""
    kinds: dict[tuple[tuple[str, ...], bool | None], list[Stall]] = {}
    for each in found:
        kinds.setdefault((each.sides, each.current), []).append(each)
    columns = {sides: f"motor.{getattr(robot.drive, sides[0])}.duty" for sides, _ in kinds}
    return tuple((columns[kind[0]], _describe_stall(kind, each, robot)) for kind, each in kinds.items())


def _describe_stall(
    kind: tuple[tuple[str, ...], bool | None], found: Sequence[Stall], robot: RobotConfig
) -> str:
    sides, current = kind
    if len(sides) > 1:
        who = "neither wheel turned although both were driven"
        why = {
            None: "held by a wall, or switched off",
            False: "the battery's voltage shows no current: both motors were switched off, by an emergency "
            "stop or a program whose end is not recorded",
            True: "the battery's voltage shows their current: held, by a wall for instance",
        }
    else:
        port = getattr(robot.drive, sides[0])
        who = f"motor {port} ({sides[0]}) did not turn although it was driven"
        why = {
            None: "unplugged, its fuse tripped, or jammed",
            False: "the battery's voltage shows no current of it: unplugged, or its fuse tripped",
            True: "the battery's voltage shows its current: jammed, or held by something",
        }
    spans = describe_spans([(each.start, each.end) for each in found])
    return f"{spans} {who}: {why[current]}; nothing is compared there"


def find_stalls(log: Log, robot: RobotConfig) -> tuple[Stall, ...]:
    """The stalls of a log, in time order."""
    if log.seconds < MIN_DRIVE_S or not log.duty.any():
        return ()
    time = np.arange(log.time[0], log.time[-1], BIN_S)
    full = full_voltage(log, robot)
    found = []
    for index, side in enumerate(SIDES):
        speed = _bemf_volts(log, robot, side, time)
        if speed is None:
            continue
        command = full * values_at_bins(log.time, log.duty[:, index], time, BIN_S)
        found += [(start, end, side) for start, end in _stalled_bins(command, speed, full)]
    return tuple(_with_current(each, log, robot, time, full) for each in _merged(found, time))


def _bemf_volts(log: Log, robot: RobotConfig, side: str, time: Array) -> Array | None:
    """Back-EMF of a wheel in each bin, V, NaN without a reading; None without a channel of the wheel."""
    wheel = log.wheel(side)
    if wheel is None:
        return None
    motor = robot.model.left if side == "left" else robot.model.right
    return volts_per_unit(wheel, motor) * bin_means(bin_indices(log.time, time), wheel.values, len(time))


def _stalled_bins(volts: Array, speed: Array, full: float) -> list[tuple[int, int]]:
    """First bin and end bin (exclusive) of each stall of one wheel: from falling behind its command until it
    follows one again. volts: the command's voltage, V. speed: back-EMF, V. full: the battery's voltage, V."""
    driven = np.abs(volts) > DRIVEN_SHARE * full
    share = np.where(driven, speed / np.where(driven, volts, 1.0), np.nan)
    follows = np.zeros(len(volts), bool)
    for start, end in runs_of_true(share > MIN_FOLLOWING_SHARE):
        follows[start:end] = (end - start) * BIN_S >= MIN_FOLLOWING_S
    found: list[tuple[int, int]] = []
    for start, end in runs_of_true(np.abs(share) < MAX_STALLED_SHARE):
        if (end - start) * BIN_S < MIN_STALL_S or (found and end <= found[-1][1]):
            continue
        first = start
        while first > 0 and driven[first - 1] and not follows[first - 1]:
            first -= 1
        before = share[max(first - round(BEFORE_STALL_S / BIN_S), 0) : first]
        level = MAX_SLOWED_SHARE * float(np.nanmedian(before)) if np.isfinite(before).any() else 0.0
        while first > 0 and share[first - 1] < level:
            first -= 1
        again = np.flatnonzero(follows[end:])
        found.append((first, end + int(again[0]) if len(again) else len(volts)))
    return found


def _merged(found: Sequence[tuple[int, int, str]], time: Array) -> tuple[Stall, ...]:
    """Stalls of both wheels that mostly coincide as one, the others by themselves. time: starts of the bins,
    s."""
    edges = np.append(time, time[-1] + BIN_S)
    left = [each for each in found if each[2] == SIDES[0]]
    right = [each for each in found if each[2] == SIDES[1]]
    both = []
    for one in list(left):
        for other in list(right):
            shared = min(one[1], other[1]) - max(one[0], other[0])
            if shared > 0.5 * max(one[1] - one[0], other[1] - other[0]):
                both.append((min(one[0], other[0]), max(one[1], other[1]), SIDES))
                left.remove(one)
                right.remove(other)
                break
    alone = [(start, end, (side,)) for start, end, side in (*left, *right)]
    spans = sorted((*both, *alone))
    return tuple(Stall(float(edges[start]), float(edges[end]), sides) for start, end, sides in spans)


def _with_current(found: Stall, log: Log, robot: RobotConfig, time: Array, full: float) -> Stall:
    """The stall with whether its wheels drew current, by the drop of the battery's reading without the other
    wheel's sag."""
    battery = log.channel("battery")
    if battery is None:
        return found
    model = robot.model
    seen = bin_means(bin_indices(log.time, time), battery.values, len(time))
    sags = {}
    for index, (side, motor) in enumerate(zip(SIDES, (model.left, model.right), strict=True)):
        duty, speed = (
            values_at_bins(log.time, log.duty[:, index], time, BIN_S),
            _bemf_volts(log, robot, side, time),
        )
        if speed is None:
            return found
        current = duty * (full * duty - speed) / motor.armature_resistance.value
        sags[side] = model.battery.internal_resistance.value * np.maximum(current, 0.0)
    inside = (time >= found.start) & (time < found.end)
    its = sum((sags[side] for side in found.sides), np.zeros(len(time)))
    others = sum((each for side, each in sags.items() if side not in found.sides), np.zeros(len(time)))
    rest = seen + its + others
    for_long = np.convolve((its > MIN_STALL_SAG_V).astype(float), np.ones(round(BATTERY_DELAY_S / BIN_S)))[
        : len(time)
    ]
    asked = inside & (for_long >= round(BATTERY_DELAY_S / BIN_S)) & np.isfinite(seen + its + others)
    free = ~inside & np.isfinite(rest)
    if asked.sum() * BIN_S < MIN_STALL_S or free.sum() * BIN_S < MIN_STALL_S:
        return found
    down = float(np.median(rest[free])) - seen[asked] - others[asked]
    part = float(np.mean(down) / np.mean(its[asked]))
    known = False if part < MAX_NO_CURRENT_SHARE else True if part > MIN_CURRENT_SHARE else None
    return replace(found, current=known)
