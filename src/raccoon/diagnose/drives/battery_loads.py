"""Battery loads other than the wheels: servos, motors on other ports, a short circuit.

The simulation of the drive does not know their current. Their sag lowers the battery's reading and the
voltage of the drive motors, by 1 to 3 %. If it were attributed to the wheels, a load at rest would make the
battery's resistance appear too small, and a load that stays on would look like a discharging battery. So
nothing is compared while other loads act.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.battery_sag import SagResidual
from raccoon.diagnose.drives.log import MIN_DRIVE_S, SETTLING_DRIVE_S, Load, Log

Array = NDArray[np.float64]

MAX_LISTED = 3
MIN_PART_S = 2.0 * MIN_DRIVE_S
"""Shortest part of a drive, s, that is compared in place of the whole drive."""
LOADED_DRIVE_NOTE = (
    "something other than the wheels draws current for most of the drive, as the battery's voltage shows: "
    "that may explain what is reported about the battery"
)

LOOSE_CONTACT_HINT = (
    "; if nothing else drew current then, look for a loose contact: the battery's plug, its wires, a fuse"
)


def find_loads(log: Log, columns: Mapping[str, Array], robot: RobotConfig) -> Log:
    """The log with the loads other than the wheels that its battery reading shows. columns: of the recording;
    they name servos and other motors.

    A load that stays on may leave too little of the drive before it; then the part before it is left out
    instead. Likewise, if a load is on from the start and leaves too little after it, the part after it is
    left out: a fuller battery that was put in during the recording looks like this. The part that is left out
    is a `Load` with a negative sag.
    """
    sight = SagResidual.of(log)
    found = () if sight is None else tuple(sight.loads())
    if sight is None or not found:
        return log
    if sight.is_enough_without(found):
        return replace(
            log, loads=tuple(replace(each, by=_active_columns(each, columns, robot)) for each in found)
        )
    stays = next((each for each in found if sight.is_on_from(each.start, found)), None)
    if stays is not None and log.time[0] + SETTLING_DRIVE_S < stays.start < log.time[-1] - MIN_PART_S:
        begin = stays.start + SETTLING_DRIVE_S
        kept = find_loads(log.between(begin, np.inf), columns, robot)
        left = replace(stays, start=float(log.time[0]), end=begin, sag=-stays.sag)
    elif _is_on_from_start(found[0], log) and not sight.is_enough_without(found[:1]):
        end = found[0].end - SETTLING_DRIVE_S
        kept = find_loads(log.between(-np.inf, end), columns, robot)
        left = replace(found[0], start=end, end=float(log.time[-1]) + SETTLING_DRIVE_S, sag=-found[0].sag)
    else:
        return replace(log, notes=(*log.notes, LOADED_DRIVE_NOTE))
    in_order = sorted((left, *kept.loads), key=lambda each: each.start)
    return replace(log, notes=kept.notes, loads=tuple(in_order))


def _is_on_from_start(load: Load, log: Log) -> bool:
    """Whether a load is on from the start of the log, for long enough to be the only part that is
    compared."""
    return bool(load.start < log.time[0] + SETTLING_DRIVE_S and load.end > log.time[0] + MIN_PART_S)


def load_notes(log: Log, resistance: float) -> tuple[str, ...]:
    """Notes about a log's loads, () without loads. resistance: of the battery, ohm."""
    seen = [each for each in log.loads if each.start < log.time[-1] and each.end > log.time[0]]
    found = [each for each in seen if each.sag > 0.0]
    told = [_left_out_note(each, log, resistance) for each in seen if each.sag < 0.0]
    if found:
        said = "; ".join(_describe_load(each, log.time, resistance) for each in found[:MAX_LISTED])
        more = f" and {len(found) - MAX_LISTED} more" if len(found) > MAX_LISTED else ""
        doubt = "" if any(each.by for each in found) else LOOSE_CONTACT_HINT
        told.append(
            f"something other than the wheels draws current, as the battery's voltage shows: {said}{more}; "
            f"nothing is compared there, since the simulation knows the wheels' current only{doubt}"
        )
    return tuple(told)


def _left_out_note(load: Load, log: Log, resistance: float) -> str:
    """Note about the part that was left out before a load that stays on, or after one that was on from the
    start."""
    sag = _describe_sag(load, resistance)
    if load.start > log.time[0]:
        return (
            f"until {load.start + SETTLING_DRIVE_S:.1f} s the battery's voltage is lower by {sag} "
            "than from then on: something other than the wheels drew current, or another battery was put in; "
            "the time after it is not compared, and that may explain what is reported about the battery's "
            "voltage"
        )
    return (
        f"from {load.end - SETTLING_DRIVE_S:.1f} s on something other than the wheels draws current: the "
        f"battery's voltage is lower by {sag}; the time before it is not compared, and what is reported "
        "about the battery's voltage includes that load"
    )


def _describe_load(load: Load, time: Array, resistance: float) -> str:
    by = f" ({', '.join(load.by)})" if load.by else ""
    start, end = max(load.start, time[0]), min(load.end, time[-1])
    exchanged = " or another battery" if start == time[0] or end == time[-1] else ""
    return f"{start:.1f} to {end:.1f} s {_describe_sag(load, resistance)}{exchanged}{by}"


def _describe_sag(load: Load, resistance: float) -> str:
    sag = abs(load.sag)
    return f"{1000.0 * sag:.0f} mV" + (f", {sag / resistance:.1f} A" if resistance > 0.0 else "")


def _active_columns(load: Load, columns: Mapping[str, Array], robot: RobotConfig) -> tuple[str, ...]:
    """Columns of servos that move, and of other motors that are powered, around the time of the load."""
    time = columns["t"]
    wheels = {f"motor.{port}.duty" for port in (robot.drive.left, robot.drive.right)}
    found = []
    for name, values in columns.items():
        known = np.flatnonzero(np.isfinite(values) & (time <= load.end))
        first = np.searchsorted(time[known], load.start - SETTLING_DRIVE_S)
        seen = values[known[max(first - 1, 0) :]]  # including the value in force at the start
        moves = name.startswith("servo.") and len(seen) > 0 and float(np.ptp(seen)) > 0.0
        powered = name.endswith(".duty") and name not in wheels and bool(seen.any())
        if moves or powered:
            found.append(name)
    return tuple(found)
