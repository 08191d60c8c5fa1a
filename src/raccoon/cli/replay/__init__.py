"""`raccoon replay`: run the odometry or a program on a recording, and compare the result with the recorded
one and the truth."""

from __future__ import annotations

import argparse
from pathlib import Path

from raccoon.cli.outputs import check_folders, check_matplotlib, check_not_read, check_replaceable
from raccoon.cli.recording_argument import recording_path
from raccoon.core.errors import ConfigError

HELP = "run the odometry, or a program, on a recording and compare with what it holds"
PICTURES = (".svg", ".png", ".pdf")


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "file",
        type=recording_path,
        metavar="recording",
        nargs="+",
        help="a trace, a CSV or MCAP file, an OptiOdom session, or a folder of them",
    )
    parser.add_argument(
        "--robot",
        type=Path,
        help="robot.toml (default: the one in the recording, or beside it, or in this folder)",
    )
    parser.add_argument(
        "--program",
        type=Path,
        help="a program with mission(robot): check that it gives the same commands again",
    )
    parser.add_argument(
        "--ignore-commands",
        action="store_true",
        help="do not compare the commands of --program with the recorded ones",
    )
    parser.add_argument(
        "--tolerance", type=float, default=0.0, help="relative difference that --program allows (0: none)"
    )
    parser.add_argument("--json", type=Path, metavar="OUT", help="write the results as JSON")
    parser.add_argument("--plot", type=Path, metavar="OUT", help="draw the drives as .svg, .png or .pdf")


def run(args: argparse.Namespace) -> int:
    """Replay the recordings, write the files and print the report. Returns 0 if it ran, whatever it found,
    and 2 if one of several files cannot be used, which does not stop the others. Raises ConfigError."""
    from raccoon.cli.replay.each_file import BAD_FILE, replay_each
    from raccoon.cli.replay.report import print_report, report, write_json
    from raccoon.core.config import load_robot
    from raccoon.trace.loading import files_of

    if not 0.0 <= args.tolerance < 1.0:
        raise ConfigError(f"--tolerance {args.tolerance}: allowed are numbers from 0 to below 1")
    for name, given in (("ignore-commands", args.ignore_commands), ("tolerance", args.tolerance > 0.0)):
        if given and args.program is None:
            raise ConfigError(f"--{name}: it only applies to --program; name a program")
    _check_outputs(args)
    robot = None if args.robot is None else load_robot(args.robot)
    files = files_of(*args.file)
    if args.program is not None:
        from raccoon.cli.replay.program import replay_program

        return replay_program(args, files, robot)
    from raccoon.cli.replay.drive import replay_odometry

    drives, failed = replay_each(files, lambda each: replay_odometry(each, robot))
    results = report(drives, failed)
    try:  # files first: a closed pipe ends the command when it prints
        if args.json is not None:
            write_json(results, args.json)
        if args.plot is not None and drives:
            from raccoon.cli.replay.picture import draw

            draw(drives, args.plot)
    finally:
        print_report(results)
    if args.plot is not None and drives:
        print(f"drawn to {args.plot}")
    return BAD_FILE if failed else 0


def _check_outputs(args: argparse.Namespace) -> None:
    """Raise ConfigError for outputs that cannot be written or would overwrite inputs, before the work
    begins."""
    from raccoon.trace.record import recording_file

    if args.plot is not None and args.plot.suffix not in PICTURES:
        raise ConfigError(f"--plot {args.plot}: allowed are the endings {', '.join(PICTURES)}")
    for name, path in (("json", args.json), ("plot", args.plot)):
        if path is not None and args.program is not None:
            raise ConfigError(
                f"--{name} {path}: --program prints what it finds and writes nothing; leave one out"
            )
    if args.plot is not None:
        check_matplotlib()
    check_folders(args.plot, args.json)
    check_not_read((args.plot, args.json), [*map(recording_file, args.file), args.robot, args.program])
    check_replaceable(args.json)
