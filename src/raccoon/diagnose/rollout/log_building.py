"""From columns to a log: in which unit, what was driven freely, and when samples were taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.answers import check_answers, check_signs
from raccoon.diagnose.drives.at_once import with_battery_before_commands
from raccoon.diagnose.drives.features import with_readings
from raccoon.diagnose.drives.held import LIFTED, not_free, of_free_driving, spans, with_free_driving
from raccoon.diagnose.drives.joined import joined, said_of_recording
from raccoon.diagnose.drives.loads import with_loads
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.drives.order import check_order
from raccoon.diagnose.drives.standing import with_what_turned
from raccoon.diagnose.drives.stops import with_stops
from raccoon.diagnose.drives.units import check_units, check_wheel_signs, driven_freely
from raccoon.diagnose.drives.ways import check_signed, check_ways, check_zero
from raccoon.diagnose.rollout.firmware import Firmware

Columns = Mapping[str, NDArray[np.float64]]

MOSTLY = 0.5
"""Share of a recording: a robot that turns as no wheel does for longer is hardly in a hand all the time."""


def understood(every: Sequence[Columns], robot: RobotConfig, firmware: Firmware | None) -> Log:
    """Each recording by itself, then all as one log. Raises TraceError for one that cannot be used."""
    if len(every) == 1:
        return _one(every[0], robot, firmware)
    logs = []
    for number, each in enumerate(every):
        with said_of_recording(number):
            logs.append(_one(each, robot, firmware))
    return joined(logs)


def _one(columns: Columns, robot: RobotConfig, firmware: Firmware | None) -> Log:
    log = log_from_columns(columns, robot)
    check_signs(log)
    check_signed(log, robot)
    held = not_free(log, robot)
    if sum(each.end - each.start for each in held if each.why == LIFTED) > MOSTLY * log.seconds:
        # Nobody carries a robot about for so long: it is the sign of one reading or motor, or a gyro's zero.
        check_wheel_signs(log, robot)
        check_ways(log, robot)
        check_zero(log, robot)
    native = firmware is not None and firmware.units
    check_units(driven_freely(log, robot, spans(held)), robot, native=native)
    try:
        log = with_free_driving(log, held)
    except TraceError as error:  # a gyro that is an angle looks like a hand from beginning to end
        try:
            check_answers(log)
        except TraceError as other:
            raise TraceError(f"{error}. Or {other}") from None
        raise
    log = with_what_turned(log, robot)
    free = with_battery_before_commands(with_stops(of_free_driving(log)))
    check_order(free)
    check_answers(free)
    if firmware is not None:
        free = of_free_driving(firmware.understood(log, columns, robot))
        if not native:  # a logger of a team's own, whose rows are what it makes of them
            free = with_battery_before_commands(with_stops(free))
        if firmware.chain.battery_held:  # such a reading is low without a load
            return with_readings(free)
    return with_readings(with_loads(free, columns, robot))
