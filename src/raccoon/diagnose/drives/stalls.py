"""Wheels that stand although they are driven: a plug that fell out, motors that were switched off, a jam.

No number of a robot makes a wheel stand at nearly a fifth of the battery's voltage. What is found so is left
out as a stretch that was not driven freely, and said, with what the battery's voltage tells of it: a motor
that stands draws the most current that it ever draws, and one without a plug none.
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
"""s over which commands and readings are averaged."""
DRIVEN_SHARE = 0.18
"""Of the battery's voltage that surely drives a wheel."""
MAX_STALLED_SHARE, MIN_FOLLOWING_SHARE = 0.1, 0.5
"""Part of its command's voltage up to which a wheel's back-EMF stands, and from which it follows."""
MIN_STALL_S, MIN_FOLLOWING_S = 0.4, 0.1
"""s for which a wheel stands at least, and for which it follows where it does again."""
BEFORE_STALL_S, MAX_SLOWED_SHARE = 1.0, 0.9
"""s before, whose median part is what it has while it follows; and part of that below which it has begun to
roll out."""
MIN_STALL_SAG_V = 0.015
"""V by which standing motors must take the battery down before its reading is asked."""
MAX_NO_CURRENT_SHARE, MIN_CURRENT_SHARE = 0.25, 0.5
"""Part of that up to which there is no current, and from which there is."""
BATTERY_DELAY_S = 0.3
"""s that a battery's reading is behind."""


@dataclass(frozen=True, slots=True)
class Stall:
    """From when to when, s, which wheels stood. current: whether they drew any, None where that is not
    known."""

    start: float
    end: float
    sides: tuple[str, ...]
    current: bool | None = None


def leave_out_stalls(log: Log, robot: RobotConfig) -> Log:
    """The log without stretches in which wheels stood although they were driven: they are among what is lost,
    and in `stalls`. The same log where there are none.

    Raises TraceError where too little is left.
    """
    known, seen = log.held, find_stalls(log, robot)
    if not seen:
        return log
    found = [each for each in seen if not any(_covers(span, each) for span in known)]
    # Of what is left out already only what the battery tells is news.
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
    """For each kind of it a column and a sentence, without the point at the end."""
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
    """Where wheels stood although they were driven, in the order of time."""
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
    """V of back-EMF in each bin, NaN where nothing was read."""
    wheel = log.wheel(side)
    if wheel is None:
        return None
    motor = robot.model.left if side == "left" else robot.model.right
    return volts_per_unit(wheel, motor) * bin_means(bin_indices(log.time, time), wheel.values, len(time))


def _stalled_bins(volts: Array, speed: Array, full: float) -> list[tuple[int, int]]:
    """First and one after the last bin of each stretch in which one wheel stood: from where it fell behind
    its command until it follows one again."""
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
    """Stretches of both wheels that are mostly the same as one; the others apart."""
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
    """The stretch with whether its wheels drew current: by how far the battery's reading went down, the other
    wheel's doing left out."""
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
