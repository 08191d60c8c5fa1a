"""`raccoon calibrate ...`: compute calibrations from recordings and drives, and store them.

Each kind of calibration is a sub-command: a function in this file adds it to the parser, and a module does
the work.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from raccoon.cli.outputs import check_folders, check_not_read
from raccoon.cli.recording_argument import recording_path
from raccoon.cli.wheel_excitation import add_arguments
from raccoon.core.errors import ConfigError

HELP = "measure wheels, motors or tophats: show the numbers, and store them with --write"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add one sub-command per kind of calibration."""
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    for add in (_add_drive, _add_motors, _add_tophats):
        add(kinds)
    for kind in kinds.choices.values():
        kind.set_defaults(parser=kind)


def run(args: argparse.Namespace) -> int:
    """Run the sub-command. Returns the exit status."""
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
        "--robot", type=Path, default=Path("robot.toml"), help="the robot's description (%(default)s)"
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
    parser.add_argument(
        "--tape-std",
        type=float,
        default=0.002,
        metavar="M",
        help="standard deviation of METRES, m (%(default)g)",
    )
    parser.add_argument(
        "--write", action="store_true", help="write the result to robot.toml (default: only show it)"
    )
    parser.set_defaults(calibrate=_calibrate_drive)


def _calibrate_drive(args: argparse.Namespace) -> int:
    from raccoon.cli.calibrate.drive import calibrate

    return calibrate(args)


def _add_motors(kinds: Any) -> None:
    text = "drive ahead and back, and find the factor k by which the faster motor gets less power"
    parser = kinds.add_parser(
        "motors",
        help=text,
        description=(
            "Drive the robot (within 0.3 m ahead, and back; as far as it says on larger wheels) and find the "
            "factor k of each motor, power_factor in robot.toml, that its power is multiplied by: the faster "
            "one gets less, so that at the same power both turn alike. It takes no recording. It is for "
            "programs that give the power themselves, such as motors(0.8, 0.8): straight, turn and the other "
            "motions make up for unequal motors without it."
        ),
    )
    add_arguments(parser)
    parser.set_defaults(calibrate=_calibrate_motors)


def _calibrate_motors(args: argparse.Namespace) -> int:
    from raccoon.cli.calibrate.motors import calibrate

    return calibrate(args)


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
        "--store", type=Path, default=Path("tophats.json"), help="file of the calibrations (%(default)s)"
    )
    parser.add_argument(
        "--set",
        help="name of the surface, such as practice-table (default: default); with --show only this one",
    )
    parser.add_argument("--show", action="store_true", help="show the stored calibrations and their history")
    parser.add_argument("--write", action="store_true", help="store the result (default: only show it)")
    parser.set_defaults(calibrate=_calibrate_tophats)


def _calibrate_tophats(args: argparse.Namespace) -> int:
    from raccoon.cli.calibrate.tophats import calibrate_recordings, show_store
    from raccoon.estimate.tophat.store import TophatStore
    from raccoon.trace.record import recording_file

    # For example from an empty variable of a script: no program would find a set of this name.
    if args.set is not None and not args.set.strip():
        raise ConfigError("--set: the name of the set is empty")
    if args.show and (args.recording or args.write):
        given = str(args.recording[0]) if args.recording else "--write"
        raise ConfigError(f"--show: it only shows what is stored; leave out {given}")
    if args.recording:
        if args.write:  # before the work, not after it
            check_folders(args.store)
            check_not_read([args.store], [*map(recording_file, args.recording), args.robot])
            TophatStore(args.store).history()
        return calibrate_recordings(
            args.recording, args.robot, args.store, args.set or "default", write=args.write
        )
    if not args.show:
        raise ConfigError("name a recording of a drive over a line, or add --show")
    return show_store(args.store, args.set)
