"""Entry point: diagnoses a recording according to its kind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import SI_WORDS, Device
from raccoon.diagnose.drives.holdout import naming_holdout
from raccoon.diagnose.hypotheses.base_coordinates import describe_missing_stds, with_default_stds
from raccoon.diagnose.own import OwnEffect
from raccoon.diagnose.recordings.channels.counters import counters_named_in_errors
from raccoon.diagnose.recordings.drive import NO_MODEL, Drive, diagnose_drive
from raccoon.diagnose.recordings.firmware.identity import identify_firmware
from raccoon.diagnose.recordings.firmware.recognition import recognise_firmware
from raccoon.diagnose.recordings.geometry.diagnosis import diagnose_geometry
from raccoon.diagnose.recordings.holdout_check import check_holdout
from raccoon.diagnose.recordings.joint_checks import check_joint_recordings
from raccoon.diagnose.recordings.kind import Kind, as_float_columns, check_robot, kind_of
from raccoon.diagnose.recordings.motors.diagnosis import diagnose_motors
from raccoon.diagnose.recordings.motors.step_response import diagnose_step_response, step_port
from raccoon.diagnose.recordings.no_comparison import diagnose_without_comparison
from raccoon.diagnose.recordings.plausibility.overridden_model import overridden_model_notes
from raccoon.diagnose.recordings.rows.first_time import with_times_from_first_row
from raccoon.diagnose.recordings.rows.repeated import without_duplicate_times
from raccoon.diagnose.recordings.rows.selection import (
    select_rows,
    select_unique_rows,
    select_unique_rows_of_each,
)
from raccoon.diagnose.recordings.tophats.diagnosis import diagnose_tophats
from raccoon.diagnose.result import Diagnosis
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.file_hints import unnamed
from raccoon.trace.problems import without_repeats

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

NO_CAUSES = "the effects of --causes were not considered: only a drive is explained by them"
TRUTH_PREFIX = "truth."
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

    columns: arrays of equal length by name, in the units of docs/trace-format.md, including `t` (s). robot:
    the configuration it is compared with. holdout: columns of another recording on which to judge. model:
    effects of a model.toml from which to start. more: further drives of the same robot and device in the same
    state, fitted together with the first. truth_free: use no `truth.*` column of any recording. device: gives
    the worth of a tick of `motor.N.position` and the delay of its back-EMF if robot.toml has only the
    defaults. problems: what the reader of the recording had to leave out, for the notes. own: further effects
    to consider in a drive beside the catalogue. port: controller.port of the device that made a recording
    which does not name it (see `firmware/identity.py`). Raises TraceError as `diagnose` does,
    CalibrationError if a reference cannot be used, and HoldoutError for a holdout of another kind or with the
    same samples.
    """
    begin = perf_counter()
    check_robot(robot)
    columns, time_notes = with_times_from_first_row(as_float_columns(columns))
    more = [with_times_from_first_row(as_float_columns(each))[0] for each in more]
    holdout = None if holdout is None else with_times_from_first_row(as_float_columns(holdout))[0]
    recordings = (columns, holdout or {}, *more)
    has_truth = any(name.startswith(TRUTH_PREFIX) for each in recordings for name in each)
    if truth_free:
        columns, *more = map(_without_truth, (columns, *more))
        holdout = None if holdout is None else _without_truth(holdout)
    columns, duplicate_notes = without_duplicate_times(columns)
    kind = kind_of(columns, robot)
    check_joint_recordings([columns, *(without_duplicate_times(each)[0] for each in more)], robot)
    columns, row_notes = select_rows(columns, kind)
    more, row_notes_of_more = select_unique_rows_of_each(more, kind)
    row_notes = (*time_notes, *duplicate_notes, *row_notes, *row_notes_of_more)
    holdout_note = ""
    if holdout is not None:
        with naming_holdout():
            holdout, row_notes_of_holdout = select_unique_rows(holdout, kind)
            row_notes = (*row_notes, *(f"the other recording: {each}" for each in row_notes_of_holdout))
            holdout_note = check_holdout(columns, holdout, kind, kind_of(holdout, robot))
    if kind is Kind.STEP:
        found = diagnose_step_response(columns, step_port(columns) or 0)
    elif kind is Kind.MOTORS:
        found = diagnose_motors(columns, robot, holdout)
    elif kind is Kind.GEOMETRY:
        holdout_runs = () if holdout is None else (holdout,)
        found = diagnose_geometry([columns], robot, holdout=holdout_runs, device=device)
    elif kind is Kind.TOPHATS:
        found = diagnose_tophats(columns, robot, model, truth_free)
    elif kind is Kind.NOTHING:
        found = diagnose_without_comparison(columns, robot)
    else:
        open_robot, exact = with_default_stds(robot)
        identity = recognise_firmware(identify_firmware(device, columns, robot, port), columns, open_robot)
        with counters_named_in_errors(columns):
            found = diagnose_drive(
                Drive(columns, open_robot, identity, holdout, more, model, truth_free, own)
            )
        overridden = overridden_model_notes(found.causes, robot)
        found = replace(found, notes=(*found.notes, *describe_missing_stds(exact), *overridden))
    if kind in (Kind.DRIVE, Kind.NOTHING):
        problems = (*problems, *filter(None, (unnamed(columns),)))
    problems = (*problems, *_unused_option_notes(kind, model, own, truth_free and not has_truth))
    notes = dict.fromkeys(
        (*found.notes, *without_repeats(problems), *row_notes, *filter(None, (holdout_note,)))
    )
    return replace(found, notes=tuple(notes), seconds=perf_counter() - begin)  # searches given up included


def _unused_option_notes(
    kind: Kind, model: Parameters | None, own: Sequence[OwnEffect], is_truth_missing: bool
) -> list[str]:
    """Notes on arguments that have no use for a recording of this kind."""
    unused = {
        NO_MODEL: model is not None and kind not in (Kind.DRIVE, Kind.TOPHATS),
        NO_CAUSES: bool(own) and kind is not Kind.DRIVE,
        NO_TRUTH: is_truth_missing,
    }
    return [note for note, is_unused in unused.items() if is_unused]


def _without_truth(columns: Columns) -> Columns:
    return {name: each for name, each in columns.items() if not name.startswith(TRUTH_PREFIX)}
