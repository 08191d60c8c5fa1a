"""From columns to a log: units checked, obstructed driving left out, samples at the times they were taken."""

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
"""Share of a recording for which the gyro may turn without the wheels because the robot is carried; beyond it
a sign or a zero is wrong."""


def build_log(every: Sequence[Columns], robot: RobotConfig, firmware: Firmware | None) -> Log:
    """One log of all recordings, each checked by itself. Raises TraceError for one that cannot be used."""
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
        # Nobody carries a robot for so long: a reading or a motor has the wrong sign, or the gyro's zero is
        # off.
        check_wheel_signs(log, robot)
        check_motor_directions(log, robot)
        check_gyro_zero(log, robot)
    native = firmware is not None and firmware.is_named_by_recording
    check_units(only_free_driving(log, robot, spans_of(held)), robot, native=native)
    try:
        log = leave_out_obstructed(log, held)
    # a gyro column that is an angle looks as if the robot were carried all the time
    except TraceError as error:
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
        if not native:  # a team's own logger, whose rows need not be the controller's cycles
            free = without_battery_after_commands(with_brake_by_stop(free))
        if firmware.chain.battery_held:  # a held reading can be low while no load is on
            return without_empty_channels(free)
    return without_empty_channels(find_loads(free, columns, robot))
