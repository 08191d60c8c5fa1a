"""Recognises a Wombat firmware that nobody named, by its dead zone and the response of the wheels.

Its filter and pauses are not in the catalogue, so without them a search takes minutes and finds six false
causes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.progress import report
from raccoon.core.readings import Device
from raccoon.diagnose.drives.excitation import is_driven
from raccoon.diagnose.habits.controller import fit_habits
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.recordings.channels.counters import with_counter_bemf
from raccoon.diagnose.recordings.channels.faulty import without_faulty_channels
from raccoon.diagnose.recordings.channels.volt_commands import has_volt_commands
from raccoon.diagnose.recordings.firmware.filter_prior import with_device_filter
from raccoon.diagnose.recordings.firmware.identity import FirmwareIdentity
from raccoon.diagnose.rollout.firmware import Firmware, firmware_of
from raccoon.diagnose.rollout.log_building import build_log

Columns = Mapping[str, NDArray[np.float64]]

CLOCK_FOUND = -np.inf


def recognise_firmware(identity: FirmwareIdentity, columns: Columns, robot: RobotConfig) -> FirmwareIdentity:
    """The candidate identity if the counters show its clock or the wheels fit it better than any other
    controller; else the given identity, since a robot may have such a dead zone of its own.

    With counters, 21 of 21 drives behind two emulated firmwares were recognised, without them 17; and none of
    18 with a similar dead zone behind another controller.
    """
    firmware = None if identity.candidate is None else firmware_of(identity.candidate.device)
    if identity.candidate is None or firmware is None or has_volt_commands(columns, robot):
        return identity
    report("asking which firmware made the recording")
    try:
        candidate_misfit = _controller_misfit(columns, robot, firmware, identity.candidate.device)
        is_candidate = candidate_misfit == CLOCK_FOUND or candidate_misfit < _controller_misfit(
            columns, robot, firmware, identity.device
        )
    except TraceError:  # the diagnosis raises it again
        return identity
    return identity.candidate if is_candidate else identity


def _controller_misfit(
    columns: Columns, robot: RobotConfig, zone_firmware: Firmware, device: Device
) -> float:
    """Misfit of the wheels to the device's controller; `CLOCK_FOUND` if their counters show its clock.

    zone_firmware: firmware whose dead zone is assumed in any case, so that readings in it have no influence.
    """
    firmware = firmware_of(device)
    columns = without_faulty_channels(with_counter_bemf(columns, robot, device).columns, robot).columns
    robot = with_device_filter(device, robot)
    if firmware is not None:
        firmware = replace(firmware, is_named_by_recording=False)
        columns = firmware.undo_truncation(columns)
    log = build_log([columns], robot, firmware)
    if any(each is not None for each in log.clocks):
        return CLOCK_FOUND
    causes = zone_firmware.without_known_causes(drive_causes(), filters=firmware is not None)
    return (
        fit_habits(log, robot, causes, zone_firmware.with_dead_zone(robot, None), firmware).log_misfit
        if is_driven(log)
        else np.inf
    )
