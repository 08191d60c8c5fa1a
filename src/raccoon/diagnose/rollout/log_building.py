"""From columns to a log: in which unit, what was driven freely, and when samples were taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.battery_loads import find_loads
from raccoon.diagnose.drives.battery_timing import without_battery_after_commands
from raccoon.diagnose.drives.directions import check_gyro_zero, check_motor_directions, check_wheel_directions
from raccoon.diagnose.drives.features import without_empty_channels
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.drives.log_joining import join_logs, naming_recording
from raccoon.diagnose.drives.obstructions import (
    LIFTED,
    find_obstructed_stretches,
    leave_out_obstructed,
    spans_of,
    without_held_readings,
)
from raccoon.diagnose.drives.response_checks import check_responses, check_signs
from raccoon.diagnose.drives.row_order import check_row_order
from raccoon.diagnose.drives.stalls import leave_out_stalls
from raccoon.diagnose.drives.stops import with_brake_by_stop
from raccoon.diagnose.drives.units import check_units, check_wheel_signs, only_free_driving
from raccoon.diagnose.rollout.firmware import Firmware

Columns = Mapping[str, NDArray[np.float64]]

MAX_LIFTED_SHARE = 0.5
"""Share of a recording: a robot that turns as no wheel does for longer is hardly in a hand all the time."""


def build_log(every: Sequence[Columns], robot: RobotConfig, firmware: Firmware | None) -> Log:
    """Each recording by itself, then all as one log. Raises TraceError for one that cannot be used."""
    if len(every) == 1:
        return _build_one(every[0], robot, firmware)
    logs = []
    for number, each in enumerate(every):
        with naming_recording(number):
            logs.append(_build_one(each, robot, firmware))
    return join_logs(logs)


def _build_one(columns: Columns, robot: RobotConfig, firmware: Firmware | None) -> Log:
    log = log_from_columns(columns, robot)
    check_signs(log)
    check_wheel_directions(log, robot)
    held = find_obstructed_stretches(log, robot)
    if sum(each.end - each.start for each in held if each.why == LIFTED) > MAX_LIFTED_SHARE * log.seconds:
        # Nobody carries a robot about for so long: it is the sign of one reading or motor, or a gyro's zero.
        check_wheel_signs(log, robot)
        check_motor_directions(log, robot)
        check_gyro_zero(log, robot)
    native = firmware is not None and firmware.is_named_by_recording
    check_units(only_free_driving(log, robot, spans_of(held)), robot, native=native)
    try:
        log = leave_out_obstructed(log, held)
    except TraceError as error:  # a gyro that is an angle looks like a hand from beginning to end
        try:
            check_responses(log)
        except TraceError as other:
            raise TraceError(f"{error}. Or {other}") from None
        raise
    log = leave_out_stalls(log, robot)
    free = without_battery_after_commands(with_brake_by_stop(without_held_readings(log)))
    check_row_order(free)
    check_responses(free)
    if firmware is not None:
        free = without_held_readings(firmware.correct_log(log, columns, robot))
        if not native:  # a logger of a team's own, whose rows are what it makes of them
            free = without_battery_after_commands(with_brake_by_stop(free))
        if firmware.chain.battery_held:  # such a reading is low without a load
            return without_empty_channels(free)
    return without_empty_channels(find_loads(free, columns, robot))
