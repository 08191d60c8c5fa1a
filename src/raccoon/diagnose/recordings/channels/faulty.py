"""Detects faulty channels of a drive (stuck, saturated, impossible, too coarse), which are reported and left
out.

No cause is fitted to such readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.sections import CYCLE_RATE
from raccoon.diagnose.drives.log import column_names
from raccoon.diagnose.recordings.channels.battery_sag import missing_sag_fault
from raccoon.diagnose.recordings.channels.held_voltage import without_held_voltages
from raccoon.diagnose.recordings.channels.invalid_samples import command_behind, without_invalid_samples
from raccoon.diagnose.recordings.channels.saturation import (
    MIN_SAMPLES,
    saturation_fault,
    without_saturated_samples,
)
from raccoon.diagnose.recordings.reference.pose_faults import check_pose
from raccoon.diagnose.result import SensorFault

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MAX_COARSE_LEVELS = {"gyro": 8, "bemf": 4, "speed": 4}
"""Largest number of different values of a reading that is too coarse, by kind: a gyro in whole rad/s has so
few."""
MIN_COARSE_STEP_V, ROUNDING_TOLERANCE = 0.04, 0.02
"""Least rounding step of a battery's reading that is too coarse, V (a controller's own steps are finer), and
tolerance on its multiples as a share of the step. If the readings scatter by less than a step, most of the
sag is lost: rounded to 0.1 V, a battery of 0.15 ohm was estimated at 0.014, and one of 0.05 at 0; rounded to
0.05 V, one of 0.15 ohm got five times the viscous friction and another scale as well, each with a probability
of 1."""
LEFT_OUT_REASONS = {
    "stuck": "it is stuck",
    "saturated": "it is cut off",
    "coarse": "it is rounded too coarsely",
    "steady": "it does not sag",
    "rare": "it was read too rarely",
}
"""Faults for which a whole channel is left out, with the words for the reason."""
MAX_STEP_JITTER = 0.5
"""Deviation of time steps to either side, as a share of the usual step, above which the time is uneven."""
MAX_CYCLE_OFFSET = 0.16
"""Tolerance, in controller cycles, on a whole number of cycles per row: firmwares meant to run at 200 Hz run
at 174 and more."""


@dataclass(frozen=True, slots=True)
class CheckedColumns:
    """Columns without faulty readings. faults: of what was left out. notes: on the time. has_uneven_time:
    whether the time steps are too uneven to judge fast effects."""

    columns: Columns
    faults: tuple[SensorFault, ...]
    notes: tuple[str, ...]
    has_uneven_time: bool = False

    @property
    def left_out(self) -> dict[str, str]:
        """Columns that were recorded but are not used, with the reasons."""
        return {
            each.channel: LEFT_OUT_REASONS[each.fault]
            for each in self.faults
            if each.fault in LEFT_OUT_REASONS
        }


def without_faulty_channels(columns: Columns, robot: RobotConfig) -> CheckedColumns:
    """The columns without readings to which no simulation should be fitted."""
    remaining, faults = dict(columns), []
    commands_vary = _commands_vary(columns, robot)
    for role, name in column_names(robot).items():
        if name not in remaining:
            continue
        values = np.asarray(remaining[name], float)
        fault = _stuck_fault(name, role, values, commands_vary) or saturation_fault(name, role, values)
        fault = fault or _coarse_fault(name, role, values, commands_vary)
        channel_faults = [] if fault is None else [fault]
        if fault is None and role == "battery":
            remaining[name], fault = without_held_voltages(name, columns["t"], values)
            channel_faults, values = [] if fault is None else [fault], remaining[name]
        if fault is None:
            command = command_behind(role, columns, robot)
            values, end_faults = (
                (values, []) if role == "battery" else without_saturated_samples(name, values)
            )
            remaining[name], invalid_faults = without_invalid_samples(
                name, role, columns["t"], values, command
            )
            channel_faults += [*end_faults, *invalid_faults]
        faults += channel_faults
        if any(each.fault in LEFT_OUT_REASONS for each in channel_faults):
            del remaining[name]
    if no_sag := missing_sag_fault(remaining, robot):
        faults.append(no_sag)
        del remaining[no_sag.channel]
    pose, pose_faults = check_pose(remaining, robot)
    remaining |= pose
    time_notes = _uneven_time_notes(columns["t"])
    rate_notes = _row_rate_notes(columns["t"], robot.controller.rate_hz)
    return CheckedColumns(remaining, (*faults, *pose_faults), (*time_notes, *rate_notes), bool(time_notes))


def _commands_vary(columns: Columns, robot: RobotConfig) -> bool:
    """Whether the commands vary."""
    ports = (robot.drive.left, robot.drive.right)
    duties = [columns.get(f"motor.{port}.{kind}") for port in ports for kind in ("duty", "voltage")]
    return any(each is not None and np.isfinite(each).any() and np.nanstd(each) > 0.02 for each in duties)


def _stuck_fault(name: str, role: str, values: Array, commands_vary: bool) -> SensorFault | None:
    known = values[np.isfinite(values)]
    if not commands_vary or len(known) < MIN_SAMPLES or np.ptp(known) > 0.0:
        return None
    where = "read it in every cycle" if role == "battery" else "check plug and wires"
    text = f"{name} reads {float(known[0]):g} all the time although the robot is driven: {where}"
    return SensorFault(name, "stuck", text)


def _coarse_fault(name: str, role: str, values: Array, commands_vary: bool) -> SensorFault | None:
    """The fault of a reading with too few different values, None otherwise. Not checked if the robot stands
    still, since then a sound gyro has only a few values (quantised noise)."""
    known = values[np.isfinite(values)]
    if not commands_vary or len(known) < MIN_SAMPLES:
        return None
    levels = np.unique(known)
    if not (
        _is_coarsely_rounded(known, levels) if role == "battery" else _has_few_levels(role, known, levels)
    ):
        return None
    text = f"{name} has {len(levels)} different values only: it is rounded too coarsely"
    return SensorFault(name, "coarse", text)


def _has_few_levels(role: str, known: Array, levels: Array) -> bool:
    max_levels = MAX_COARSE_LEVELS.get(role.partition("_")[0], 0)
    return 1 < len(levels) <= max_levels and len(known) >= 20 * max_levels


def _is_coarsely_rounded(known: Array, levels: Array) -> bool:
    """Whether a battery's readings scatter by less than the step to which they were rounded."""
    if len(levels) < 2:
        return False
    step = float(np.diff(levels).min())
    if step < MIN_COARSE_STEP_V or float(np.std(known)) > step:
        return False
    return bool(np.abs(levels / step - np.rint(levels / step)).max() < ROUNDING_TOLERANCE)


def _uneven_time_notes(time: Array) -> tuple[str, ...]:
    steps = np.diff(time[np.isfinite(time)])
    if len(steps) < MIN_SAMPLES:
        return ()
    middle = float(np.median(steps))
    low, high = (float(each) for each in np.percentile(steps, [5.0, 95.0]))
    if high - low < MAX_STEP_JITTER * 2.0 * middle:
        return ()
    return (
        f"t is uneven: steps of {1000 * low:.1f} to {1000 * high:.1f} ms around {1000 * middle:.1f} ms; what "
        "is faster than that cannot be judged",
    )


def _row_rate_notes(time: Array, rate_hz: float) -> tuple[str, ...]:
    """A note if the row period is not a whole number of controller cycles: a wrong time base changes the
    inertia."""
    steps = np.diff(time[np.isfinite(time)])
    if len(steps) < MIN_SAMPLES:
        return ()
    cycles = float(np.median(steps)) * rate_hz
    # A time that does not advance or is in another unit is an error that the log raises.
    if cycles <= 0.0 or abs(cycles - max(round(cycles), 1)) < MAX_CYCLE_OFFSET:
        return ()
    rate = rate_hz / cycles
    advice = "if t is not right"
    if CYCLE_RATE.allows(rate):
        advice = f"if t is right, write controller.rate_hz = {rate:.3g}; if it is not"
    return (
        f"t advances by {1000.0 / rate:.3g} ms a row, but the controller runs at {rate_hz:g} Hz: "
        f"{advice}, filters, latencies and inertia will be wrong",
    )
