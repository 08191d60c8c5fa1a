"""`raccoon view`: draw a recorded drive over its table, as a picture or an animation, and print its
messages."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.outputs import check_folders, check_matplotlib
from raccoon.cli.shared_options import check_start
from raccoon.core.errors import ConfigError

if TYPE_CHECKING:
    from raccoon.cli.view.drive import Drive

HELP = "draw a recorded drive over the table, and print its steps, remarks and notes"
MAX_EVENTS_SHOWN = 100
"""Largest number of printed messages; a program may write a note in every cycle."""
ELSEWHERE = (
    "the drive goes through a wall of the Botball-size table, so it was driven elsewhere and is drawn alone: "
    "--table FILE names its table, --start X Y DEG where on it the drive began"
)
ENDINGS = (".svg", ".png", ".gif")
SLOWEST, FASTEST = 0.01, 1000.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    # This word was once required: `view run RECORDING` means the same.
    parser.add_argument("what", nargs="?", help=argparse.SUPPRESS)
    parser.add_argument("recording", type=Path, help="a recording with truth or estimates in it")
    parser.add_argument(
        "-o", "--output", type=Path, help="picture to write; .gif is an animation (drive.svg)"
    )
    parser.add_argument("--table", type=Path, help="table file; by default the Botball-size table")
    parser.add_argument("--no-table", action="store_true", help="draw the path alone")
    parser.add_argument(
        "--start", type=float, nargs=3, metavar=("X", "Y", "DEG"), help="where on the table it started"
    )
    parser.add_argument(
        "--speed", type=float, default=4.0, help="speed of the animation, times real time (%(default)g)"
    )


def run(args: argparse.Namespace) -> int:
    """Draw one drive and print its messages. Returns exit status 0. Raises ConfigError, TraceError."""
    from raccoon.cli.view.drive import goes_through_wall, load_drive
    from raccoon.sim.world.table import World

    if args.what not in (None, "run"):
        raise ConfigError(f"{args.what} and {args.recording}: one recording is drawn at a time")
    target: Path = args.output or Path("drive.svg")
    if target.suffix not in ENDINGS:
        raise ConfigError(f"{target}: allowed are the endings {', '.join(ENDINGS)}")
    if not SLOWEST <= args.speed <= FASTEST:
        raise ConfigError(f"--speed {args.speed:g}: allowed are numbers from {SLOWEST:g} to {FASTEST:g}")
    if args.start is not None:
        check_start(args.start)
    if args.table is not None and args.no_table:
        raise ConfigError(f"--table {args.table}: --no-table draws none; leave one of them out")
    check_folders(target)
    check_matplotlib()
    world = World.empty() if args.no_table else World.from_file(args.table) if args.table else World.default()
    drive = load_drive(args.recording, args.start)
    if (
        args.table is None
        and drive.truth is not None
        and goes_through_wall(drive.truth, drive.body, world.walls)
    ):
        world = World.empty()
        drive = replace(drive, problems=(*drive.problems, ELSEWHERE))
    if target.suffix == ".gif":
        from raccoon.cli.view.drawing import write_animation

        frames = write_animation(drive, world, target, args.speed)
        print(f"wrote {target}: {frames} frames of a drive of {drive.seconds:.1f} s")
    else:
        from raccoon.cli.view.drawing import write_picture

        write_picture(drive, world, target)
        print(f"wrote {target}: a drive of {drive.seconds:.1f} s and {drive.length:.2f} m")
    _print_said(drive)
    return 0


def _print_said(drive: Drive) -> None:
    for problem in drive.problems:
        print(f"note: {problem}")
    for time, text in drive.said[:MAX_EVENTS_SHOWN]:
        print(f"{time:8.2f} s  {text}")
    if len(drive.said) > MAX_EVENTS_SHOWN:
        print(f"and {len(drive.said) - MAX_EVENTS_SHOWN} more, all in the column event of raccoon convert")
