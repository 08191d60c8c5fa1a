"""The work of `raccoon calibrate drive` (not a command of its own)."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping, Sequence

from raccoon.cli.measured_values import is_any_simulated, write_if_asked
from raccoon.cli.outputs import check_folders
from raccoon.cli.progress import show_progress
from raccoon.core.config import Measured, RobotConfig, load_robot
from raccoon.core.errors import CalibrationError, ConfigError, TraceError
from raccoon.core.readings import Outputs
from raccoon.diagnose.reports.numbers import value_with_std_text
from raccoon.estimate.drive_calibration.columns import TapedWay, manoeuvre_from_columns
from raccoon.estimate.drive_calibration.disturbance import find_disturbance
from raccoon.estimate.drive_calibration.fit import calibrate_drive
from raccoon.estimate.drive_calibration.straight import calibrate_straight
from raccoon.robot.actions.limits import LONGEST_WAY_M
from raccoon.trace.columns import cycles_of
from raccoon.trace.loading import Run, load_runs
from raccoon.trace.recording import median_step, time_unit_hint

UNITS = {"radians_per_tick": "rad", "bemf_offset": "counts", "track_width": "m"}
"""Units of the calibrated values, by the last part of their key."""


def calibrate(args: argparse.Namespace) -> int:
    """Calibrate on recordings, print the values and, with `--write`, store them. Returns the exit status.
    Raises ConfigError, TraceError, CalibrationError."""
    _check_lengths(args)
    robot = load_robot(args.robot)
    if args.write:
        check_folders(args.robot)
    with show_progress():
        runs = load_runs(*args.recording)
    for each in runs:
        if mistaken := time_unit_hint(median_step(each.recording["t"])):
            raise TraceError(f"{each.path}: {mistaken}")
    entries = _straight(args, robot, runs) if args.straight is not None else _manoeuvre(args, robot, runs)
    _show(entries)
    return write_if_asked(args, entries, is_any_simulated(runs))


def _check_lengths(args: argparse.Namespace) -> None:
    """Raise ConfigError for lengths or standard deviations, m, that are out of range."""
    if not 0.0 < args.tape_std < math.inf:
        raise ConfigError(f"--tape-std {args.tape_std:g}: allowed are numbers above 0 (m)")
    if args.straight is not None:
        if not 0.0 < abs(args.straight) <= LONGEST_WAY_M:
            raise ConfigError(
                f"--straight {args.straight:g}: allowed are numbers other than 0, up to {LONGEST_WAY_M:g} m "
                "either way (60 cm are 0.60)"
            )
        if args.tape_std >= 0.5 * abs(args.straight):
            raise ConfigError(
                f"--tape-std {args.tape_std:g}: it must be below half of --straight {args.straight:g} (m)"
            )


def _straight(args: argparse.Namespace, robot: RobotConfig, runs: Sequence[Run]) -> Mapping[str, Measured]:
    if len(runs) != 1 or args.tape:
        there = f"{len(runs)} recordings" if len(runs) != 1 else f"--tape {args.tape[0]}"
        raise ConfigError(f"--straight takes one recording and no --tape: given are {there}")
    cycles = list(cycles_of(runs[0].recording))
    inputs = [each for each, _ in cycles]
    # The command of a cycle is in force when the next cycle is read.
    before: list[tuple[Outputs, ...]] = [(), *(commands for _, commands in cycles)]
    in_force = [commands[-1] if commands else None for commands in before]
    if why := find_disturbance(robot, zip(inputs, in_force, strict=False)):
        raise CalibrationError(f"{args.recording[0]}: this drive cannot be used for the calibration: {why}")
    found = calibrate_straight(robot, inputs, args.straight, distance_std=args.tape_std)
    print(f"by tape {args.straight:g} m, by robot.toml as it was {found.expected:.3f} m")
    for remark in found.remarks:
        print(f"look here: {remark}")
    return found.entries(robot)


def _manoeuvre(args: argparse.Namespace, robot: RobotConfig, runs: Sequence[Run]) -> Mapping[str, Measured]:
    taped = [_taped(text, args.tape_std) for text in args.tape]
    if taped and len(runs) != 1:
        raise ConfigError(f"--tape is for one recording: there are {len(runs)}")
    try:
        made = [
            manoeuvre_from_columns(run.recording.columns, robot, taped=taped, device=run.recording.device)
            for run in runs
        ]
        found = calibrate_drive(robot, made, device=runs[0].recording.device)
    except CalibrationError as error:
        raise CalibrationError(
            f"{error}; if this is one straight drive, give its length: --straight METRES"
        ) from None
    for remark in found.remarks:
        print(f"look here: {remark}")
    print(f"weighted error {found.error_before:.2f} before, {found.error_after:.2f} after")
    return found.entries(robot)


def _taped(text: str, std: float) -> TapedWay:
    try:
        begin, end, metres = (float(part) for part in text.split(":"))
    except ValueError:
        raise ConfigError(f"--tape {text}: allowed is BEGIN:END:METRES, such as 2.0:6.5:0.60") from None
    if not (0.0 < abs(metres) <= LONGEST_WAY_M and begin < end):
        raise ConfigError(
            f"--tape {text}: BEGIN must be before END, and METRES not 0, up to {LONGEST_WAY_M:g} "
            "(60 cm are 0.60)"
        )
    return TapedWay(begin, end, metres, std)


def _show(entries: Mapping[str, Measured]) -> None:
    """Print each value with its standard deviation."""
    for key, value in entries.items():
        # A relative deviation is meaningless for a value that may be 0, such as an offset.
        known = 3.0 * value.std < abs(value.value)
        share = f" ({100 * value.std / abs(value.value):.2f} %)" if known else ""
        battery = "" if value.battery_voltage is None else f" at {value.battery_voltage:.2f} V"
        unit = UNITS[key.rpartition(".")[2]]
        print(f"{key:28} {value_with_std_text(value.value, value.std, unit)}{share}{battery}")
