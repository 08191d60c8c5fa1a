"""Reviews a diagnosis: which claims hold, given the faults of the recording's channels and the remaining
error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.counting import counting_error
from raccoon.diagnose.drives.log import column_names, has_readings
from raccoon.diagnose.findings.deviations import without_deviation_notes
from raccoon.diagnose.fleet.other_robots import (
    ROBOT_CONSTANTS,
    ROBOT_TOML_QUESTION,
    is_far_off,
    with_doubted_robot,
)
from raccoon.diagnose.recordings.channels.curved_readings import with_curved_readings
from raccoon.diagnose.recordings.channels.faulty import CheckedColumns
from raccoon.diagnose.recordings.channels.missing import describe_absence
from raccoon.diagnose.result import CauseResult, Diagnosis, Rejected, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MIN_CHANGE_WHEN_UNEVEN = 1.0
"""Least change of a reading, in units of its noise, by a cause that is believed although the time is uneven.
Time stamps off by up to 2 ms gave a fault-free drive a gear that loses 2 %, with a change of 0.34."""
MAX_ERROR_SHARE = 0.5
"""Remaining error over the standard deviation of the reading above which the simulation does not follow the
commands."""
MAX_LARGE_ERROR_SHARE, MIN_LARGE_ERROR = 0.15, 0.03
"""The same if the error in volts also exceeds this share of the battery's voltage, which a creeping wheel's
does not. With any cause, known or not, it was 0.03 at most; commands rounded to whole numbers left more."""
MAX_EXPLAINED_ERROR_SHARE, MIN_UNEXPLAINED_ERROR = 0.04, 0.015
"""The same shares for a back-EMF whose error the named causes do not explain. Readings with 4 % of the other
motor's in them left 0.05 and 0.022 beside a scale of both, which has the wrong sign in straight driving."""


def with_channel_faults(
    found: Diagnosis, columns: Columns, checked: CheckedColumns, robot: RobotConfig
) -> Diagnosis:
    """The diagnosis with the channel faults; without causes if the simulation does not follow the recorded
    motion."""
    found = replace(
        found, sensor_faults=(*checked.faults, *found.sensor_faults), notes=(*found.notes, *checked.notes)
    )
    found = _without_causes_of_uneven_time(found) if checked.has_uneven_time else found
    unchecked_notes = (*_unmeasured_wheel_notes(checked, robot), *_unchecked_notes(found, checked, robot))
    unfollowed = [
        each.name for each in found.channels if _is_unfollowed(each.name, each.rmse_after, columns, robot)
    ]
    if not unfollowed:
        found = with_curved_readings(_doubted_for_large_errors(found, columns, robot))
        robot_causes = [each for each in found.causes if each.id in ROBOT_CONSTANTS and each.where is None]
        found = replace(found, notes=(*found.notes, *unchecked_notes, *wrong_robot_notes(robot_causes)))
        return with_doubted_robot(found)
    reason = f"the recorded motion does not follow the commands ({', '.join(unfollowed)}): no cause is named"
    dropped = tuple(Rejected(each.name, reason) for each in found.causes)
    question = f"{reason}; are commands and readings of the same drive?"
    return replace(
        found, verdict=Verdict.UNKNOWN, causes=(), rejected=(*found.rejected, *dropped), model=None,
        notes=(*without_deviation_notes(found.notes), *unchecked_notes, question),
    )  # fmt: skip


def _without_causes_of_uneven_time(found: Diagnosis) -> Diagnosis:
    """The diagnosis without causes that an uneven time could explain as well."""
    dropped = [each for each in found.causes if each.change < MIN_CHANGE_WHEN_UNEVEN]
    if not dropped:
        return found
    kept = tuple(each for each in found.causes if each not in dropped)
    reason = "not judged: t is uneven, which may look like a cause of this size"
    verdict = found.verdict
    if not any(not each.is_negligible for each in kept):
        verdict = Verdict.NOT_IDENTIFIABLE
    elif verdict is Verdict.EXPLAINED:
        verdict = Verdict.PARTLY
    ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(kept, start=1))
    rejected = (*found.rejected, *(Rejected(each.name, reason) for each in dropped))
    return replace(found, verdict=verdict, causes=ranked, rejected=rejected, model=None)


def _unchecked_notes(found: Diagnosis, checked: CheckedColumns, robot: RobotConfig) -> tuple[str, ...]:
    """Notes on causes that could not be judged because a whole channel is missing, and are not ruled out."""
    notes = []
    for role, name in column_names(robot).items():
        reason = describe_absence(name, checked.left_out)
        ids = [each.id for each in found.rejected if each.reason == f"not identifiable: {reason}"]
        if ids:
            notes.append(f"not checked, since {reason}: {', '.join(ids)}")
        elif (
            role == "battery"
            and found.channels
            and not has_readings(checked.columns, name)
            and not _has_no_duties(checked, robot)
        ):
            notes.append(f"{reason}: the battery was checked by the wheels alone")
    return tuple(notes)


def _has_no_duties(checked: CheckedColumns, robot: RobotConfig) -> bool:
    """Whether no wheel has duties: voltage commands hide the battery and have their own note."""
    ports = (robot.drive.left, robot.drive.right)
    return not any(has_readings(checked.columns, f"motor.{port}.duty") for port in ports)


def _doubted_for_large_errors(found: Diagnosis, columns: Columns, robot: RobotConfig) -> Diagnosis:
    """The diagnosis; not as explained if an error of the back-EMF is left that no cause leaves."""
    large = {
        each.name: share
        for each in found.channels
        if each.name.endswith(".bemf")
        for share, volts in [_remaining_error(each.name, each.rmse_after, columns, robot)]
        if share > MAX_EXPLAINED_ERROR_SHARE and volts > MIN_UNEXPLAINED_ERROR
    }
    if found.verdict is not Verdict.EXPLAINED or not large:
        return found
    said = " and ".join(f"{100.0 * share:.0f} % of {name}'s" for name, share in large.items())
    note = (
        f"the causes leave a large error in the wheels' readings ({said} spread), as none of the catalogue "
        "does: something else is wrong as well, or instead; does the reading of one motor change when only "
        "the other one turns?"
    )
    return replace(found, verdict=Verdict.PARTLY, notes=(*found.notes, note))


def _is_unfollowed(name: str, error: float, columns: Columns, robot: RobotConfig) -> bool:
    share, volts = _remaining_error(name, error, columns, robot)
    return share > MAX_ERROR_SHARE or (volts > MIN_LARGE_ERROR and share > MAX_LARGE_ERROR_SHARE)


def _remaining_error(name: str, error: float, columns: Columns, robot: RobotConfig) -> tuple[float, float]:
    """The error of a wheel's reading beyond the counting of ticks, over the reading's standard deviation and,
    in volts, over the battery's voltage; 0 for other channels."""
    if name not in columns or not name.endswith((".bemf", ".speed")):
        return 0.0, 0.0
    error = math.sqrt(max(error**2 - counting_error(columns[name]) ** 2, 0.0))
    share = error / max(float(np.nanstd(columns[name])), 1e-300)
    model = robot.model
    volts_per_unit = BEMF_VOLTS_PER_COUNT if name.endswith(".bemf") else model.left.back_emf_constant.value
    return share, error * volts_per_unit / model.battery.open_circuit_voltage.value


def _unmeasured_wheel_notes(checked: CheckedColumns, robot: RobotConfig) -> tuple[str, ...]:
    """A note on a wheel that is not measured although the other one is."""
    missing = {
        port: not any(has_readings(checked.columns, f"motor.{port}.{kind}") for kind in ("bemf", "speed"))
        for port in (robot.drive.left, robot.drive.right)
    }
    if all(missing.values()) or not any(missing.values()):
        return ()
    port = next(each for each, is_missing in missing.items() if is_missing)
    name = next(
        (each for each in checked.left_out if each.startswith(f"motor.{port}.")), f"motor.{port}.bemf"
    )
    return (f"{describe_absence(name, checked.left_out)}: causes that only this wheel shows are not checked",)


def wrong_robot_notes(causes: Sequence[CauseResult]) -> tuple[str, ...]:
    """A note that asks whether robot.toml is this robot's, if a cause's factor is far from 1."""
    for each in causes:
        if is_far_off(each):
            percent = 100.0 * (each.parameters["factor"].value - 1.0)
            return (f"{each.name} is off by {percent:+.0f} %: {ROBOT_TOML_QUESTION}",)
    return ()
