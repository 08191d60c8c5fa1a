"""`raccoon calibrate ...`: make calibrations of recordings and put them into robot.toml.

Each kind is one sub-command: a function that adds it to the parser and one that does it.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from raccoon.cli.inputs import recording_path
from raccoon.cli.motors import add_calibration, put_in_if_asked, recorded_in_simulation
from raccoon.cli.outputs import check_folders, check_not_read
from raccoon.core.config import Measured, RobotConfig, load_robot
from raccoon.core.errors import CalibrationError, ConfigError, TraceError

if TYPE_CHECKING:
    from raccoon.core.readings import Outputs
    from raccoon.estimate.drive_calibration.columns import TapedWay
    from raccoon.trace.loading import Run

UNITS = {"radians_per_tick": "rad", "bemf_offset": "counts", "track_width": "m"}
"""Of what is measured, by the last part of its key."""
HELP = "measure wheels, motors or tophats: show the numbers, and store them with --write"


def configure(parser: argparse.ArgumentParser) -> None:
    """A sub-command a kind of calibration."""
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    for add in (_add_drive, add_calibration, _add_tophats):
        add(kinds)
    for kind in kinds.choices.values():
        kind.set_defaults(parser=kind)


def run(args: argparse.Namespace) -> int:
    """Do the sub-command's calibration."""
    return cast(Callable[[argparse.Namespace], int], args.calibrate)(args)


def _add_drive(kinds: Any) -> None:
    text = (
        "radians a tick and back-EMF offsets of the wheels, and the track width, from drives of known length"
    )
    parser = kinds.add_parser(
        "drive",
        help=text,
        description=(
            "Find radians a tick and back-EMF offset of each wheel, and the track width, from recordings. "
            "One straight drive along a tape, from rest to rest, gives the wheels (--straight METRES); a "
            "drive with straight pieces that were measured (--tape) or a reference in it, and turns both "
            "ways, gives the track width too. open_robot(..., record=FILE) makes the recording. "
            "The robot stands before it and after it: begin and end its program with wait(1.0)."
        ),
    )
    parser.add_argument(
        "recording", nargs="+", type=recording_path, help="traces or CSV files, or folders of them"
    )
    parser.add_argument(
        "--robot", type=Path, default=Path("robot.toml"), help="the robot's description (robot.toml)"
    )
    parser.add_argument(
        "--straight",
        type=float,
        metavar="METRES",
        help="the recording is one straight drive of this length by tape, from rest to rest",
    )
    parser.add_argument(
        "--tape",
        action="append",
        default=[],
        metavar="BEGIN:END:METRES",
        help="a straight piece from BEGIN to END (s of the recording) that measures METRES (may be repeated)",
    )
    parser.add_argument("--tape-std", type=float, default=0.002, metavar="M", help="of the tape, m (0.002)")
    parser.add_argument(
        "--write", action="store_true", help="put the result into robot.toml (else only show it)"
    )
    parser.set_defaults(calibrate=_calibrate_drive)


def _calibrate_drive(args: argparse.Namespace) -> int:
    from raccoon.cli.doing import doing_shown
    from raccoon.trace.loading import load_runs
    from raccoon.trace.recording import mistaken_step, usual_step

    _check_lengths(args)
    robot = load_robot(args.robot)
    if args.write:
        check_folders(args.robot)
    with doing_shown():
        runs = load_runs(*args.recording)
    for each in runs:
        if mistaken := mistaken_step(usual_step(each.recording["t"])):
            raise TraceError(f"{each.path}: {mistaken}")
    entries = _straight(args, robot, runs) if args.straight is not None else _manoeuvre(args, robot, runs)
    _show(entries)
    return put_in_if_asked(args, entries, recorded_in_simulation(runs))


def _check_lengths(args: argparse.Namespace) -> None:
    """Raise ConfigError for lengths that no tape measures."""
    from raccoon.robot.actions.limits import LONGEST

    if not 0.0 < args.tape_std < math.inf:
        raise ConfigError(f"--tape-std {args.tape_std:g}: allowed are numbers above 0 (m)")
    if args.straight is not None:
        if not 0.0 < abs(args.straight) <= LONGEST:
            raise ConfigError(
                f"--straight {args.straight:g}: allowed are numbers other than 0, up to {LONGEST:g} m either "
                "way (60 cm are 0.60)"
            )
        if args.tape_std >= 0.5 * abs(args.straight):
            raise ConfigError(
                f"--tape-std {args.tape_std:g}: it must be below half of --straight {args.straight:g} (m)"
            )


def _straight(args: argparse.Namespace, robot: RobotConfig, runs: Sequence[Run]) -> Mapping[str, Measured]:
    from raccoon.estimate.drive_calibration.disturbed import disturbed
    from raccoon.estimate.drive_calibration.straight import calibrate_straight
    from raccoon.trace.columns import cycles_of

    if len(runs) != 1 or args.tape:
        there = f"{len(runs)} recordings" if len(runs) != 1 else f"--tape {args.tape[0]}"
        raise ConfigError(f"--straight takes one recording and no --tape: given are {there}")
    cycles = list(cycles_of(runs[0].recording))
    inputs = [each for each, _ in cycles]
    # What was commanded in a cycle is in force when the next one is read.
    before: list[tuple[Outputs, ...]] = [(), *(commands for _, commands in cycles)]
    in_force = [commands[-1] if commands else None for commands in before]
    if why := disturbed(robot, zip(inputs, in_force, strict=False)):
        raise CalibrationError(f"{args.recording[0]}: this drive tells nothing: {why}")
    found = calibrate_straight(robot, inputs, args.straight, distance_std=args.tape_std)
    for remark in found.remarks:
        print(f"look here: {remark}")
    return found.entries(robot)


def _manoeuvre(args: argparse.Namespace, robot: RobotConfig, runs: Sequence[Run]) -> Mapping[str, Measured]:
    from raccoon.estimate.drive_calibration.columns import manoeuvre
    from raccoon.estimate.drive_calibration.fit import calibrate_drive

    taped = [_taped(text, args.tape_std) for text in args.tape]
    if taped and len(runs) != 1:
        raise ConfigError(f"--tape is for one recording: there are {len(runs)}")
    try:
        made = [
            manoeuvre(run.recording.columns, robot, taped=taped, device=run.recording.device) for run in runs
        ]
        found = calibrate_drive(robot, made, device=runs[0].recording.device)
    except CalibrationError as error:
        raise CalibrationError(f"{error}; of one straight drive say its length: --straight METRES") from None
    for remark in found.remarks:
        print(f"look here: {remark}")
    print(f"weighted error {found.error_before:.2f} before, {found.error_after:.2f} after")
    return found.entries(robot)


def _taped(text: str, std: float) -> TapedWay:
    from raccoon.estimate.drive_calibration.columns import TapedWay
    from raccoon.robot.actions.limits import LONGEST

    try:
        begin, end, metres = (float(part) for part in text.split(":"))
    except ValueError:
        raise ConfigError(f"--tape {text}: allowed is BEGIN:END:METRES, such as 2.0:6.5:0.60") from None
    if not (0.0 < abs(metres) <= LONGEST and begin < end):
        raise ConfigError(
            f"--tape {text}: BEGIN must be before END, and METRES not 0, up to {LONGEST:g} (60 cm are 0.60)"
        )
    return TapedWay(begin, end, metres, std)


def _show(entries: Mapping[str, Measured]) -> None:
    """Each value with its deviation."""
    from raccoon.diagnose.reports.numbers import measured_text

    for key, value in entries.items():
        # A share of what may well be 0, such as an offset, tells nothing.
        known = 3.0 * value.std < abs(value.value)
        share = f" ({100 * value.std / abs(value.value):.2f} %)" if known else ""
        battery = "" if value.battery_voltage is None else f" at {value.battery_voltage:.2f} V"
        unit = UNITS[key.rpartition(".")[2]]
        print(f"{key:28} {measured_text(value.value, value.std, unit)}{share}{battery}")


def _add_tophats(kinds: Any) -> None:
    text = "white and black of each tophat, of a drive over a line; or show what is stored"
    parser = kinds.add_parser("tophats", help=text, description=text)
    parser.add_argument(
        "recording", nargs="*", type=recording_path, help="traces or CSV files of a drive over a line"
    )
    parser.add_argument(
        "--robot",
        type=Path,
        default=Path("robot.toml"),
        help="names the sensors and their ports (robot.toml)",
    )
    parser.add_argument(
        "--store", type=Path, default=Path("tophats.json"), help="file of the calibrations (tophats.json)"
    )
    parser.add_argument(
        "--set",
        help="name of the surface, such as practice-table (without it: default); with --show only this one",
    )
    parser.add_argument("--show", action="store_true", help="show the stored calibrations and their history")
    parser.add_argument("--write", action="store_true", help="store the result (else only show it)")
    parser.set_defaults(calibrate=_calibrate_tophats)


def _calibrate_tophats(args: argparse.Namespace) -> int:
    from raccoon.cli.calibrate.tophats import calibrate_recordings, show_store
    from raccoon.estimate.tophat.store import TophatStore
    from raccoon.trace.record import recording_file

    # A variable of a script, say, that is empty: no program would find the set.
    if args.set is not None and not args.set.strip():
        raise ConfigError("--set: the name of the set is empty")
    if args.recording:
        if args.write:  # before the work, not after it
            check_folders(args.store)
            check_not_read([args.store], [*map(recording_file, args.recording), args.robot])
            TophatStore(args.store).history()
        return calibrate_recordings(
            args.recording, args.robot, args.store, args.set or "default", write=args.write
        )
    if not args.show:
        raise ConfigError("name a recording of a drive over a line, or say --show")
    return show_store(args.store, args.set)
