"""Replay of the odometry on a recorded run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from raccoon.cli.progress import show_progress
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.progress import REPORT_PERIOD_CYCLES, report
from raccoon.core.readings import STOP, Inputs, Outputs
from raccoon.diagnose.drives.gravity import describe_wrong_acceleration
from raccoon.diagnose.drives.units import describe_wrong_units
from raccoon.diagnose.rollout.firmware import firmware_of
from raccoon.estimate.drive.odometry import Odometry
from raccoon.trace.columns import cycles_of
from raccoon.trace.file_hints import misnamed_columns_note, unnamed
from raccoon.trace.loading import Run, find_robot_toml
from raccoon.trace.pose_error import PoseError, pose_error
from raccoon.trace.recording import Column, median_step, time_unit_hint

COLUMNS = ("x", "y", "heading", "x_std", "y_std", "heading_std")
RECORDED = {"x": 0, "y": 1, "heading": 2}
"""Index of each value in the recorded annotation `drive`."""


@dataclass(slots=True)
class Drive:
    """The result of the odometry on a run.

    estimate: values of every row by COLUMNS (m, rad). status, reasons: of the final estimate. error: relative
    to the truth in the recording, None if it has none. deviation: largest difference from the estimate
    recorded while driving (m or rad), None if none was recorded. notes: doubts about the recording.
    """

    run: Run
    estimate: dict[str, Column]
    status: str
    reasons: tuple[str, ...] = ()
    error: PoseError | None = None
    deviation: float | None = None
    notes: list[str] = field(default_factory=list)


def replay_odometry(run: Run, robot: RobotConfig | None = None) -> Drive:
    """Run the odometry on a recorded run.

    robot: the robot to assume; None: the one in the recording, else that of a robot.toml beside it, else the
    default robot. Raises TraceError if the recording has no wheel positions or back-EMF.
    """
    notes: list[str] = []
    config = robot or run.robot
    if config is None:
        config, _, taken = find_robot_toml(run)
        notes.append(
            f"the recording does not contain its robot: compared with {taken} (--robot names another)"
        )
    if len(run.recording):  # a recording that ended before its first cycle has no columns to check
        _check_wheels(run, config)
    if mistaken := time_unit_hint(median_step(run.recording["t"])):
        notes.append(f"{mistaken}; where the robot went between two of them is unknown")
    native = firmware_of(run.recording.device) is not None
    columns = run.recording.columns
    for strange in (
        describe_wrong_units(columns, config, native=native),
        describe_wrong_acceleration(columns),
    ):
        if strange:
            notes.append(f"{strange}; the odometry took it as it is")
    odometry = Odometry(config)
    with show_progress():
        rows = _estimates(run, odometry)
    table = np.array(rows, np.float64).reshape(-1, len(COLUMNS))
    drive = Drive(run, dict(zip(COLUMNS, table.T, strict=True)), "", notes=notes)
    drive.status, drive.reasons = odometry.estimate.status.value, odometry.estimate.reasons
    _compare(drive)
    return drive


def _estimates(run: Run, odometry: Odometry) -> list[list[float]]:
    """The odometry's estimate in each cycle, in the order of COLUMNS."""
    rows: list[list[float]] = []
    command, standing = None, STOP if _has_commands(run) else None
    for inputs, commands in _cycles(run):
        estimate = odometry.update(inputs, command or standing)
        rows.append([getattr(estimate, name) for name in COLUMNS])
        command = commands[-1] if commands else command
        if len(rows) % REPORT_PERIOD_CYCLES == 0:
            report(f"{run.name}: odometry over {len(rows)} of {len(run.recording)} cycles")
    return rows


def _check_wheels(run: Run, config: RobotConfig) -> None:
    for port in (config.drive.left, config.drive.right):
        if not any(f"motor.{port}.{channel}" in run.recording for channel in ("position", "bemf")):
            names = misnamed_columns_note(run.recording.columns) or unnamed(run.recording.columns)
            raise TraceError(
                f"{run.name}: neither motor.{port}.position nor motor.{port}.bemf is in it, "
                f"and {config.name} drives on the ports {config.drive.left} and {config.drive.right}"
                f"{names and f'; {names}'}"
            )


def _cycles(run: Run) -> Iterator[tuple[Inputs, tuple[Outputs, ...]]]:
    """Inputs and commands of each cycle, as raw words if the recording has them: they give the same estimate
    bit for bit."""
    if run.trace is not None:
        return ((tick.inputs, tick.commands) for tick in run.trace.ticks)
    return cycles_of(run.recording)


def _has_commands(run: Run) -> bool:
    return bool(run.recording.ports("motor", "duty"))


def _compare(drive: Drive) -> None:
    recording, estimate = drive.run.recording, drive.estimate
    if recording.has_truth and len(recording):
        drive.error = pose_error(recording, estimate["x"], estimate["y"], estimate["heading"])
    names = {name: f"estimate.drive.{place}" for name, place in RECORDED.items()}
    if len(recording) and all(name in recording for name in names.values()):
        differences = [np.abs(recording[column] - estimate[name]) for name, column in names.items()]
        drive.deviation = float(np.nanmax(differences)) if np.isfinite(differences).any() else math.nan
