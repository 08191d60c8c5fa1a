"""`raccoon excite`: drive a manoeuvre that separates causes, and record it."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raccoon.core.config import RobotConfig

HELP = "drive a safe manoeuvre that shows or separates causes, and record it"
DEFAULT_MAX_SECONDS = 20.0
"""Default bound on the duration of a drive that is chosen for a cause, s."""

MIN_EVIDENCE = 1.0
"""Threshold on the evidence of a drive, below which no number of repetitions in one recording identifies the
cause."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--robot", type=Path, default=Path("robot.toml"), help="robot.toml (default: in this folder)"
    )
    parser.add_argument(
        "--manoeuvre",
        help="manoeuvre to drive (default: the best one for --cause; without --cause the checkup)",
    )
    parser.add_argument("--cause", help="cause to show, such as drive.backlash or bemf.scale@left")
    parser.add_argument(
        "--rival", action="append", default=[], help="cause to distinguish it from (repeatable)"
    )
    parser.add_argument(
        "--within", type=float, default=1.0, help="m, free space around the robot (default %(default)g)"
    )
    parser.add_argument(
        "--seconds",
        type=float,
        help=f"s, longest drive (default {DEFAULT_MAX_SECONDS:g} with --cause; the checkup always takes 40)",
    )
    parser.add_argument(
        "--simulate", action="store_true", help="drive the simulated robot, on an empty floor"
    )
    parser.add_argument(
        "--model", type=Path, help="with --simulate: model.toml of the robot to drive, with its effects"
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="seed of the simulated robot's noise (default %(default)s); another seed is another drive",
    )
    parser.add_argument("--record", type=Path, help="recording to write; without it nothing is driven")


def run(args: argparse.Namespace) -> int:
    """Print the advice; with `--record`, drive and record. Returns the exit status. Raises ConfigError for
    bad options."""
    from raccoon.cli.shared_options import check_seed
    from raccoon.core.config import load_robot
    from raccoon.core.errors import ConfigError
    from raccoon.diagnose.experiment.manoeuvres import CHECKUP
    from raccoon.trace.record import existing_recording

    check_seed(args.seed)
    robot = load_robot(args.robot)
    _check(args)
    if robot.controller.port == "create" and not args.simulate:
        print(
            "note: a Create has encoders, but no back-EMF and no gyro: its drive shows less than predicted "
            "here, and nothing of imu.* and bemf.*"
        )
    if args.model is not None and not args.simulate:
        raise ConfigError(f"--model {args.model}: only a simulated robot has one; add --simulate")
    if args.rival and args.cause is None:
        raise ConfigError(f"--rival {args.rival[0]}: name the --cause to distinguish it from")
    if args.manoeuvre is not None and args.cause is not None:
        raise ConfigError(
            f"--cause {args.cause}: --manoeuvre {args.manoeuvre} is driven whatever the cause; leave one out"
        )
    if args.cause is not None:
        chosen = _choose_best(args, robot)
    else:
        chosen = args.manoeuvre or CHECKUP
        _check_and_describe(robot, chosen, args)
    if args.record is not None:
        _drive(robot, chosen, args)
        print(f"{existing_recording(args.record) or args.record}: recorded {chosen!r}")
    else:
        print(f"nothing was driven: --record FILE drives {chosen!r} and records it")
    return 0


def _check(args: argparse.Namespace) -> None:
    """Raise ConfigError for options whose error would otherwise show only after the drive, or never."""
    from raccoon.cli.outputs import check_recording
    from raccoon.core.errors import ConfigError

    for name, value in (("within", args.within), ("seconds", args.seconds)):
        if value is not None and not 0.0 < value < math.inf:
            raise ConfigError(f"--{name} is {value}: allowed are numbers above 0")
    if args.record is not None:
        check_recording(args.record)


def _check_and_describe(robot: RobotConfig, name: str, args: argparse.Namespace) -> None:
    """Print the time and space that a manoeuvre needs and, if it is not driven, what it would show. Raises
    ConfigError if it needs more than `--seconds` or `--within` allow."""
    from raccoon.cli.numba_check import check_numba
    from raccoon.cli.progress import show_progress
    from raccoon.core.errors import ConfigError
    from raccoon.core.progress import report
    from raccoon.diagnose.experiment.advice import DrivePlan, estimate_reach
    from raccoon.diagnose.experiment.manoeuvres import RATE, manoeuvre

    duty = manoeuvre(name)
    reach = estimate_reach(robot, duty)
    lasts = len(duty) / RATE
    print(f"{name}: {lasts:.1f} s, within {reach:.2f} m of where it starts")
    if args.seconds is not None and lasts > args.seconds:
        raise ConfigError(
            f"--seconds {args.seconds:g}: {name} takes {lasts:.1f} s, and is driven whole or not at all; "
            "allow more, or name a --cause or another --manoeuvre"
        )
    if reach > args.within:
        raise ConfigError(
            f"--within {args.within:g}: {name} needs {reach:.2f} m of free space around the robot"
        )
    if args.record is None and duty.any():
        check_numba("to predict what it would show, it is simulated with every cause")
        print("would show, on this robot, if nothing else is wrong:")
        with show_progress():
            report("what each cause would change in it")
            sizes = DrivePlan.of(robot, duty).visible_sizes()
        for id_, size in sizes.items():
            print(f"  {id_:30s} {size or 'not at all'}")


def _choose_best(args: argparse.Namespace, robot: RobotConfig) -> str:
    from raccoon.cli.numba_check import check_numba
    from raccoon.cli.progress import show_progress
    from raccoon.core.errors import ConfigError
    from raccoon.diagnose.experiment.advice import DECISIVE_EVIDENCE, rank_manoeuvres

    check_numba(
        f"--cause {args.cause}: the best drive for it is found by simulating all of them (--manoeuvre "
        "without --cause drives one at once)"
    )
    longest = DEFAULT_MAX_SECONDS if args.seconds is None else args.seconds
    with show_progress():
        advice = rank_manoeuvres(robot, args.cause, args.rival, within=args.within, seconds=longest)
    if not advice:
        raise ConfigError(f"no manoeuvre stays within {args.within:g} m and {longest:g} s: allow more")
    besides = f"besides {' and '.join(args.rival)} " if args.rival else ""
    for each in advice:
        reach = f"reach {each.reach:.2f} m, {each.seconds:.1f} s"
        nearest = f", {besides}hardest to tell from {each.nearest}" if each.nearest else ""
        print(f"{each.manoeuvre:16s} evidence {each.evidence:7.1f}  {reach}{nearest}")
    if advice[0].evidence < MIN_EVIDENCE:
        print(
            "None of them shows it, however often it is driven: allow more --within or --seconds, or give a "
            "reference such as counted turns."
        )
    elif advice[0].evidence < DECISIVE_EVIDENCE:
        print(
            f"None of them is decisive (that needs an evidence of {DECISIVE_EVIDENCE:.0f}): drive it several "
            "times into one recording, or give a reference such as counted turns."
        )
    else:
        print(f"A drive with an evidence of {DECISIVE_EVIDENCE:.0f} or more is decisive.")
    return advice[0].manoeuvre


def _drive(robot: RobotConfig, name: str, args: argparse.Namespace) -> None:
    from dataclasses import replace
    from functools import partial

    from raccoon.diagnose.experiment.advice import estimate_reach
    from raccoon.diagnose.experiment.drive_manoeuvre import drive_and_record
    from raccoon.diagnose.experiment.manoeuvres import manoeuvre

    port = None
    if args.simulate:
        robot = replace(robot, controller=replace(robot.controller, port="sim"))
    if robot.controller.port == "sim":
        from raccoon.sim.effects.model_file import load_model
        from raccoon.sim.effects.parameters import Parameters
        from raccoon.sim.port import SimPort
        from raccoon.sim.world.table import World

        driven = Parameters.from_robot(robot) if args.model is None else load_model(args.model, robot)
        # An empty world: the default table has a wall within the free space that was asked for.
        port = SimPort(driven, World.empty(), robot=robot, seed=args.seed, rate_hz=robot.controller.rate_hz)
    duty = manoeuvre(name)
    if port is None and duty.any():
        space = f"{estimate_reach(robot, duty):.2f} m free of walls and things on every side"
        print(f"the robot will drive: put it on the floor with {space}", file=sys.stderr, flush=True)
    tell = partial(print, file=sys.stderr, flush=True)
    seed = None if port is None else args.seed
    drive_and_record(robot, duty, args.record, port, tell=tell, seed=seed)
