"""The diagnosis that fits the kind of a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.gravity import strange_acceleration
from raccoon.diagnose.drives.times import check_time
from raccoon.diagnose.drives.unseen import said_of_holdout
from raccoon.diagnose.findings.extend import with_causes
from raccoon.diagnose.hypotheses.base_coordinates import with_usual_stds, without_std
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes, own_cause
from raccoon.diagnose.own import OwnEffect
from raccoon.diagnose.recordings.channels.counters import (
    counter_reset_notes,
    counters_named_in_errors,
    with_counter_bemf,
)
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
from raccoon.diagnose.recordings.firmware.identity import FirmwareIdentity, identify_firmware
from raccoon.diagnose.recordings.firmware.recognition import recognise_firmware
from raccoon.diagnose.recordings.geometry.diagnosis import diagnose_geometry
from raccoon.diagnose.recordings.holdout_check import check_holdout
from raccoon.diagnose.recordings.joint_checks import check_joint_commands, check_joint_recordings
from raccoon.diagnose.recordings.kind import Kind, as_float_columns, check_robot, kind_of
from raccoon.diagnose.recordings.motors.diagnosis import diagnose_motors
from raccoon.diagnose.recordings.motors.step_response import diagnose_step, step_port
from raccoon.diagnose.recordings.no_comparison import diagnose_without_comparison
from raccoon.diagnose.recordings.plausibility.battery_scale import explain_by_battery_scale
from raccoon.diagnose.recordings.plausibility.command_scale import explain_by_command_scale
from raccoon.diagnose.recordings.plausibility.encoder_scale import explain_by_encoder_scale
from raccoon.diagnose.recordings.plausibility.implausible import (
    diagnose_speed_commands,
    with_plausibility_hints,
)
from raccoon.diagnose.recordings.plausibility.overridden_model import overridden_model_notes
from raccoon.diagnose.recordings.plausibility.reference_scale import explain_by_reference_scale
from raccoon.diagnose.recordings.reference.findings import with_reference_findings
from raccoon.diagnose.recordings.reference.search_start import search_start
from raccoon.diagnose.recordings.reference.units import unrelated_reference_note
from raccoon.diagnose.recordings.rows.repeated import without_duplicate_times
from raccoon.diagnose.recordings.rows.selection import (
    select_rows,
    select_unique_rows,
    select_unique_rows_of_each,
)
from raccoon.diagnose.recordings.tophats.diagnosis import diagnose_tophats, tophat_ports
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.diagnose.rollout.firmware import firmware_of
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.problems import said_once

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

_WITH_MORE = {
    Verdict.ADEQUATE: Verdict.EXPLAINED,
    Verdict.UNKNOWN: Verdict.PARTLY,
    Verdict.NOT_IDENTIFIABLE: Verdict.PARTLY,
}
"""The verdict of a drive whose tophats have causes too."""
NO_MODEL = "the effects of --model were not used: only drives by duty and tophats are simulated with them"
NO_CAUSES = "the effects of --causes were not considered: only a drive is explained by them"
TRUTH = "truth."
NO_TRUTH = "--truth-free left nothing out: no recording has a truth.* column"


def diagnose_recording(
    columns: Columns,
    robot: RobotConfig,
    *,
    holdout: Columns | None = None,
    more: Sequence[Columns] = (),
    model: Parameters | None = None,
    truth_free: bool = False,
    device: Device = SI_WORDS,
    problems: Sequence[str] = (),
    own: Sequence[OwnEffect] = (),
    port: str | None = None,
) -> Diagnosis:
    """Diagnose a recording of any kind.

    columns: arrays of equal length by the names and in the units of docs/trace-format.md, `t` (s) among them.
    robot: what it is compared with. holdout: columns of another recording, to judge on. model: a model.toml
    to start from. more: further drives of the same robot and device, as it was then, which are fitted with
    the first. truth_free: use no `truth.*` column of any of them. device: what a tick of `motor.N.position`
    is worth, and how late its back-EMF is, where robot.toml has only the default. problems: what the reader
    of the recording had to leave out; it is noted. own: effects of your own to consider in a
    drive beside the catalogue. port: controller.port of whatever made a recording that does not say so itself
    (see `firmware/named.py`). Raises TraceError as `diagnose`, and
    CalibrationError where a reference cannot be used; HoldoutError for a holdout of another kind or the same
    samples.
    """
    check_robot(robot)
    columns, more = as_float_columns(columns), [as_float_columns(each) for each in more]
    holdout = None if holdout is None else as_float_columns(holdout)
    told = any(name.startswith(TRUTH) for each in (columns, holdout or {}, *more) for name in each)
    if truth_free:
        columns, *more = map(_without_truth, (columns, *more))
        holdout = None if holdout is None else _without_truth(holdout)
    columns, repeated = without_duplicate_times(columns)
    kind = kind_of(columns, robot)
    check_joint_recordings([columns, *(without_duplicate_times(each)[0] for each in more)], robot)
    columns, of_rows = select_rows(columns, kind)
    more, of_others = select_unique_rows_of_each(more, kind)
    of_rows = (*repeated, *of_rows, *of_others)
    unused = ""
    if holdout is not None:
        with said_of_holdout():
            holdout, of_other = select_unique_rows(holdout, kind)
            of_rows = (*of_rows, *(f"the other recording: {each}" for each in of_other))
            unused = check_holdout(columns, holdout, kind, kind_of(holdout, robot))
    if kind is Kind.STEP:
        found = diagnose_step(columns, step_port(columns) or 0)
    elif kind is Kind.MOTORS:
        found = diagnose_motors(columns, robot, holdout)
    elif kind is Kind.GEOMETRY:
        others = () if holdout is None else (holdout,)
        found = diagnose_geometry([columns], robot, holdout=others, device=device)
    elif kind is Kind.TOPHATS:
        found = diagnose_tophats(columns, robot, model, truth_free)
    elif kind is Kind.NOTHING:
        found = diagnose_without_comparison(columns, robot)
    else:
        open_robot, exact = with_usual_stds(robot)
        made_by = recognise_firmware(identify_firmware(device, columns, robot, port), columns, open_robot)
        with counters_named_in_errors(columns):
            asked = _Asked(model, truth_free, own, made_by)
            found = _driven(columns, open_robot, holdout, more, asked)
        found = replace(
            found, notes=(*found.notes, *without_std(exact), *overridden_model_notes(found.causes, robot))
        )
    if model is not None and kind not in (Kind.DRIVE, Kind.TOPHATS):
        problems = (*problems, NO_MODEL)
    if own and kind is not Kind.DRIVE:
        problems = (*problems, NO_CAUSES)
    if truth_free and not told:
        problems = (*problems, NO_TRUTH)
    notes = dict.fromkeys((*found.notes, *said_once(problems), *of_rows, *filter(None, (unused,))))
    return replace(found, notes=tuple(notes))


def _without_truth(columns: Columns) -> Columns:
    return {name: each for name, each in columns.items() if not name.startswith(TRUTH)}


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked of a drive, see `diagnose_recording`, and what made its recording."""

    model: Parameters | None
    truth_free: bool
    own: Sequence[OwnEffect]
    made_by: FirmwareIdentity


def _driven(
    columns: Columns, robot: RobotConfig, holdout: Columns | None, more: Sequence[Columns], asked: _Asked
) -> Diagnosis:
    """The drive, of commanded volts by what was read of the battery, and as if the driver knew it better,
    whichever explains it.
    """
    if not has_volt_commands(columns, robot) or more:
        return _drive(columns, robot, holdout, more, asked)
    shares, other = duties_by_battery_reading(columns, robot), holdout
    if holdout is not None and has_volt_commands(holdout, robot):
        other = duties_by_battery_reading(holdout, robot)
    if shares is None or (other is None and holdout is not None):
        return _drive(columns, robot, holdout, more, asked)
    found = _drive(shares, robot, other, more, asked)
    by_duty = holdout is not None and not has_volt_commands(holdout, robot)
    if found.verdict is not Verdict.ADEQUATE and not by_duty:
        exact = _drive(columns, robot, holdout, more, asked)
        if explains_better(exact, found):
            return exact
    return replace(found, notes=(*found.notes, BY_READING_NOTE))


def _drive(
    columns: Columns, robot: RobotConfig, holdout: Columns | None, more: Sequence[Columns], asked: _Asked
) -> Diagnosis:
    """The drive, and its tophats where robot.toml names them and they saw both surfaces."""
    check_time(np.asarray(columns["t"], float))  # before a reference is compared with what depends on it
    device, model = asked.made_by.device, asked.model
    counted = with_counter_bemf(columns, robot, device)
    sound = without_faulty_channels(counted.columns, robot)
    columns = sound.columns
    holdout, more, others = _others(holdout, more, robot, device)
    firmware = firmware_of(device)
    if firmware is not None and asked.made_by.is_external:
        firmware = replace(firmware, units=False)
    told = with_device_filter(device, robot)
    filters, robot = told is not robot, told
    if firmware is not None:
        robot = firmware.known_of(robot)
        columns = firmware.before_cutting(columns)
        holdout = None if holdout is None else firmware.before_cutting(holdout)
        more = [firmware.before_cutting(each) for each in more]
    by_volts = has_volt_commands(columns, robot)
    check_joint_commands([columns, *more], robot)
    speeds = None if by_volts else diagnose_speed_commands(columns, robot, firmware)
    if speeds is not None:
        found = speeds
    elif by_volts:
        found = _by_volts(columns, robot, holdout, asked.own, device)
        others += [] if model is None else [NO_MODEL]
    else:
        start = search_start(columns, robot, model, device)
        tried = start.undecided([*drive_causes(), *map(own_cause, asked.own)])
        known = model
        if firmware is not None:
            tried, known = firmware.asked_for(tried, filters=filters), firmware.start(start.robot, model)
        found = diagnose(
            columns, start.robot, holdout=holdout, more=more, causes=tried, model=known, firmware=firmware
        )
        found = with_reference_findings(found, start, model)
    found = with_missing_columns_named(found, columns, robot, sound.left_out)
    if not by_volts:
        found = explain_by_battery_scale(with_plausibility_hints(found, columns, robot), robot)
        found = explain_by_command_scale(explain_by_encoder_scale(found, robot), robot)
    found = explain_by_reference_scale(found)
    found = counted.annotate(with_channel_faults(found, columns, sound, robot))
    gravity = strange_acceleration(columns)
    unit = (f"{gravity} (a diagnosis does not use it, and odometry does)",) if gravity else ()
    strange = tuple(filter(None, (unrelated_reference_note(columns, robot, device),)))
    anew = counter_reset_notes(columns, robot)
    found = replace(found, notes=(*found.notes, *unit, *strange, *anew, *asked.made_by.notes, *others))
    return _with_tophats(found, columns, robot, model, asked.truth_free)


def _others(
    holdout: Columns | None, more: Sequence[Columns], robot: RobotConfig, device: Device
) -> tuple[Columns | None, list[Columns], list[str]]:
    """The recordings beside the first without what is broken in them, and what that is."""
    notes: list[str] = []

    def whole(other: Columns, which: str) -> Columns:
        part = without_faulty_channels(with_counter_bemf(other, robot, device).columns, robot)
        notes.extend(f"{which}: {each}" for each in (*(fault.text for fault in part.faults), *part.notes))
        return part.columns

    if holdout is not None:
        with said_of_holdout():
            holdout = whole(holdout, "the other recording")
    return holdout, [whole(each, f"recording {number}") for number, each in enumerate(more, 2)], notes


def _by_volts(
    columns: Columns,
    robot: RobotConfig,
    holdout: Columns | None,
    own: Sequence[OwnEffect],
    device: Device,
) -> Diagnosis:
    """A drive whose commands are volts: there is nothing to be said of its battery."""
    changed, stiff, causes = duties_of_stiff_battery(columns, robot, holdout)
    other = None if holdout is None else duties_of_stiff_battery(holdout, stiff)[0]
    start = search_start(columns, stiff, None, device)
    tried = start.undecided([*causes, *map(own_cause, own)])
    found = diagnose(changed, start.robot, holdout=other, causes=tried)
    return with_battery_rejected(with_reference_findings(found, start))


def _with_tophats(
    found: Diagnosis, columns: Columns, robot: RobotConfig, model: Parameters | None, truth_free: bool
) -> Diagnosis:
    """A drive's diagnosis with that of its tophats, where it has any."""
    if not robot.tophats or not any(f"analog.{port}" in columns for port in tophat_ports(columns, robot)):
        return found
    tophats = diagnose_tophats(columns, robot, model, truth_free, of_a_drive=True)
    shift = len(found.causes)
    more = tuple(replace(each, rank=each.rank + shift) for each in tophats.causes)
    verdict = _WITH_MORE.get(found.verdict, found.verdict) if more else found.verdict
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
