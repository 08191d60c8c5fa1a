"""The diagnosis of a drive: repair of its readings, the search, and the review of the result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.gravity import describe_wrong_acceleration
from raccoon.diagnose.drives.holdout import naming_holdout
from raccoon.diagnose.drives.time_column import check_time
from raccoon.diagnose.findings.fitted_model import with_causes
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes, own_cause
from raccoon.diagnose.own import OwnEffect
from raccoon.diagnose.recordings.channels.counters import counter_reset_notes, with_counter_bemf
from raccoon.diagnose.recordings.channels.faulty import without_faulty_channels
from raccoon.diagnose.recordings.channels.missing import with_missing_columns_named
from raccoon.diagnose.recordings.channels.review import with_channel_faults
from raccoon.diagnose.recordings.channels.volt_commands import (
    BY_READING_NOTE,
    duties_by_battery_reading,
    duties_of_stiff_battery,
    explains_better,
    has_volt_commands,
    with_battery_rejected,
)
from raccoon.diagnose.recordings.firmware.filter_prior import with_device_filter
from raccoon.diagnose.recordings.firmware.identity import FirmwareIdentity
from raccoon.diagnose.recordings.joint_checks import check_joint_commands
from raccoon.diagnose.recordings.plausibility.battery_scale import explain_by_battery_scale
from raccoon.diagnose.recordings.plausibility.command_scale import explain_by_command_scale
from raccoon.diagnose.recordings.plausibility.encoder_scale import explain_by_encoder_scale
from raccoon.diagnose.recordings.plausibility.implausible import (
    diagnose_speed_commands,
    with_plausibility_hints,
)
from raccoon.diagnose.recordings.plausibility.reference_scale import explain_by_reference_scale
from raccoon.diagnose.recordings.reference.findings import with_reference_findings
from raccoon.diagnose.recordings.reference.search_start import search_start
from raccoon.diagnose.recordings.reference.units import unrelated_reference_note
from raccoon.diagnose.recordings.tophats.diagnosis import diagnose_tophats, tophat_ports
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.diagnose.rollout.firmware import Firmware, firmware_of
from raccoon.sim.effects.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

VERDICT_WITH_TOPHATS = {
    Verdict.ADEQUATE: Verdict.EXPLAINED,
    Verdict.UNKNOWN: Verdict.PARTLY,
    Verdict.NOT_IDENTIFIABLE: Verdict.PARTLY,
}
"""Verdict of a drive, by its own one, if its tophats have causes."""
NO_MODEL = "the effects of --model were not used: only drives by duty and tophats are simulated with them"


@dataclass(frozen=True, slots=True)
class Drive:
    """The recordings of a drive and their context.

    columns: of the recording that is diagnosed. robot: the configuration it is compared with. identity: the
    device and firmware that made it. holdout: the recording on which to judge. more: recordings fitted with
    the first. model, truth_free, own: as in `diagnose_recording`. firmware: its simulation, if known.
    has_device_filter: whether the prior of the back-EMF filter is the device's, not robot.toml's.
    """

    columns: Columns
    robot: RobotConfig
    identity: FirmwareIdentity
    holdout: Columns | None = None
    more: Sequence[Columns] = ()
    model: Parameters | None = None
    truth_free: bool = False
    own: Sequence[OwnEffect] = ()
    firmware: Firmware | None = None
    has_device_filter: bool = False

    @property
    def device(self) -> Device:
        """The device that made the columns."""
        return self.identity.device

    @property
    def has_volt_commands(self) -> bool:
        """Whether both wheels' commands are voltages."""
        return has_volt_commands(self.columns, self.robot)


def diagnose_drive(drive: Drive) -> Diagnosis:
    """Diagnose a drive, and its tophats if robot.toml names them and they saw both surfaces.

    Voltage commands are converted to duties by the last battery reading; if that does not explain the drive,
    they are also taken as exact voltages, and the better explanation is returned. Raises TraceError as
    `diagnose_recording` does.
    """
    by_reading = _by_battery_reading(drive)
    if by_reading is None:
        return _diagnose(drive)
    found = _diagnose(by_reading)
    is_judged_on_duties = drive.holdout is not None and not has_volt_commands(drive.holdout, drive.robot)
    if found.verdict is not Verdict.ADEQUATE and not is_judged_on_duties:
        exact = _diagnose(drive)
        if explains_better(exact, found):
            return exact
    return replace(found, notes=(*found.notes, BY_READING_NOTE))


def _by_battery_reading(drive: Drive) -> Drive | None:
    """A drive in volts with duties by the last battery reading; None for any other drive, for several
    recordings, and if the battery readings do not allow it."""
    if not drive.has_volt_commands or drive.more:
        return None
    duties, holdout = duties_by_battery_reading(drive.columns, drive.robot), drive.holdout
    if holdout is not None and has_volt_commands(holdout, drive.robot):
        holdout = duties_by_battery_reading(holdout, drive.robot)
    if duties is None or (holdout is None and drive.holdout is not None):
        return None
    return replace(drive, columns=duties, holdout=holdout)


def _diagnose(drive: Drive) -> Diagnosis:
    """Repair the readings, compare them with the simulation, and review what was found."""
    # An invalid time is an error before a reference is compared with quantities that depend on it.
    check_time(np.asarray(drive.columns["t"], float))
    counter_bemf = with_counter_bemf(drive.columns, drive.robot, drive.device)
    checked = without_faulty_channels(counter_bemf.columns, drive.robot)
    drive, fault_notes = _without_faults_in_others(replace(drive, columns=checked.columns))
    drive = _behind_firmware(drive)
    check_joint_commands([drive.columns, *drive.more], drive.robot)
    found = _compare(drive)
    found = with_missing_columns_named(found, drive.columns, drive.robot, checked.left_out)
    if not drive.has_volt_commands:
        found = with_plausibility_hints(found, drive.columns, drive.robot)
        found = explain_by_battery_scale(found, drive.robot)
        found = explain_by_encoder_scale(found, drive.robot)
        found = explain_by_command_scale(found, drive.robot)
    found = explain_by_reference_scale(found)
    found = counter_bemf.annotate(with_channel_faults(found, drive.columns, checked, drive.robot))
    no_model = [NO_MODEL] if drive.has_volt_commands and drive.model is not None else []
    notes = (*_notes(drive), *drive.identity.notes, *fault_notes, *no_model)
    return _with_tophats(replace(found, notes=(*found.notes, *notes)), drive)


def _without_faults_in_others(drive: Drive) -> tuple[Drive, list[str]]:
    """The drive with its holdout and further recordings repaired like the first one, and notes on their
    faults.

    Raises HoldoutError for a holdout that cannot be used.
    """
    notes: list[str] = []

    def repaired(columns: Columns, which: str) -> Columns:
        counted = with_counter_bemf(columns, drive.robot, drive.device)
        checked = without_faulty_channels(counted.columns, drive.robot)
        notes.extend(f"{which}: {each}" for each in (*(each.text for each in checked.faults), *checked.notes))
        return checked.columns

    holdout = drive.holdout
    if holdout is not None:
        with naming_holdout():
            holdout = repaired(holdout, "the other recording")
    more = [repaired(each, f"recording {number}") for number, each in enumerate(drive.more, 2)]
    return replace(drive, holdout=holdout, more=more), notes


def _behind_firmware(drive: Drive) -> Drive:
    """The drive with its device's filter and firmware in the robot, and with the firmware's truncation of
    back-EMF undone in the columns."""
    robot = with_device_filter(drive.device, drive.robot)
    firmware, has_device_filter = firmware_of(drive.device), robot is not drive.robot
    if firmware is None:
        return replace(drive, robot=robot, has_device_filter=has_device_filter)
    if drive.identity.is_external:
        firmware = replace(firmware, is_named_by_recording=False)
    return replace(
        drive,
        robot=firmware.with_battery_uncertainty(robot),
        columns=firmware.undo_truncation(drive.columns),
        holdout=None if drive.holdout is None else firmware.undo_truncation(drive.holdout),
        more=[firmware.undo_truncation(each) for each in drive.more],
        firmware=firmware,
        has_device_filter=has_device_filter,
    )


def _compare(drive: Drive) -> Diagnosis:
    """Diagnose a drive by volts, by speeds or by duty."""
    if drive.has_volt_commands:
        return _compare_in_volts(drive)
    by_speed = diagnose_speed_commands(drive.columns, drive.robot, drive.firmware)
    return _compare_by_duty(drive) if by_speed is None else by_speed


def _compare_by_duty(drive: Drive) -> Diagnosis:
    start = search_start(drive.columns, drive.robot, drive.model, drive.device)
    causes, model = start.undecided([*drive_causes(), *map(own_cause, drive.own)]), drive.model
    if drive.firmware is not None:
        causes = drive.firmware.without_known_causes(causes, filters=drive.has_device_filter)
        model = drive.firmware.with_dead_zone(start.robot, model)
    found = diagnose(
        drive.columns,
        start.robot,
        holdout=drive.holdout,
        more=drive.more,
        causes=causes,
        model=model,
        firmware=drive.firmware,
    )
    return with_reference_findings(found, start, drive.model)


def _compare_in_volts(drive: Drive) -> Diagnosis:
    """Diagnose a drive whose commands are exact voltages, which hide its battery."""
    columns, robot, causes = duties_of_stiff_battery(drive.columns, drive.robot, drive.holdout)
    holdout = None if drive.holdout is None else duties_of_stiff_battery(drive.holdout, robot)[0]
    start = search_start(drive.columns, robot, None, drive.device)
    undecided = start.undecided([*causes, *map(own_cause, drive.own)])
    found = diagnose(columns, start.robot, holdout=holdout, causes=undecided)
    return with_battery_rejected(with_reference_findings(found, start))


def _notes(drive: Drive) -> tuple[str, ...]:
    """Notes on oddities of the recording other than faults of its channels."""
    acceleration = describe_wrong_acceleration(drive.columns)
    notes = (
        f"{acceleration} (a diagnosis does not use it, and odometry does)" if acceleration else "",
        unrelated_reference_note(drive.columns, drive.robot, drive.device),
        *counter_reset_notes(drive.columns, drive.robot),
    )
    return tuple(filter(None, notes))


def _with_tophats(found: Diagnosis, drive: Drive) -> Diagnosis:
    """A drive's diagnosis joined with that of its tophats, if it has any."""
    columns, robot = drive.columns, drive.robot
    if not robot.tophats or not any(f"analog.{port}" in columns for port in tophat_ports(columns, robot)):
        return found
    tophats = diagnose_tophats(columns, robot, drive.model, drive.truth_free, of_a_drive=True)
    shift = len(found.causes)
    more = tuple(replace(each, rank=each.rank + shift) for each in tophats.causes)
    verdict = VERDICT_WITH_TOPHATS.get(found.verdict, found.verdict) if more else found.verdict
    if more and tophats.verdict is Verdict.PARTLY:
        verdict = Verdict.PARTLY
    return replace(
        found,
        verdict=verdict,
        channels=found.channels + tophats.channels,
        causes=found.causes + more,
        model=None if found.model is None else with_causes(found.model, more),
        rejected=found.rejected + tophats.rejected,
        curves=found.curves + tophats.curves,
        notes=found.notes + tophats.notes,
        sensor_faults=found.sensor_faults + tophats.sensor_faults,
        seconds=found.seconds + tophats.seconds,
    )
