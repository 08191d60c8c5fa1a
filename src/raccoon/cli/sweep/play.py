"""The work of `raccoon sweep`: making a match from the arguments, playing the sweep, and printing the
results."""

from __future__ import annotations

import argparse
import math
import sys
from contextlib import nullcontext
from dataclasses import replace

from raccoon.cli.crew import check_crew, open_crew
from raccoon.cli.outputs import check_folders, check_recording
from raccoon.cli.shared_options import check_seed, check_start
from raccoon.cli.sweep.bar import Bar
from raccoon.cli.sweep.report import print_report, print_row
from raccoon.core.config import RobotConfig, load_robot
from raccoon.core.errors import ConfigError
from raccoon.sim.effects.chain import FIRMWARE_IMU_HZ, Chain
from raccoon.sim.effects.model_file import load_model
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.world.table import World
from raccoon.sweep.factors import Factor, default_factors, fault_factors, parse_factor, place_of
from raccoon.sweep.limits import DEFAULT_WITHIN, DEFAULT_WITHIN_DEGREES
from raccoon.sweep.match import Match, play, seed_of
from raccoon.sweep.model_factors import factors_of_model
from raccoon.sweep.program import Program
from raccoon.sweep.runs import check_sweep, sweep, with_nominal_end
from raccoon.trace.record import existing_recording


def sweep_and_print(args: argparse.Namespace) -> int:
    """Play all matches and print the report. Returns exit status 0. Raises ConfigError."""
    if args.record is not None:
        raise ConfigError("--record is for one match: say which with --only RUN")
    check_folders(args.out)
    match = match_of(args)
    check_sweep(args.runs, args.seed, args.out)
    try:
        with Bar() as bar, open_crew(args) as crew:
            if not args.any_end:
                bar.begin()
                match = with_nominal_end(match, crew)
            played = nullcontext(crew)
            rows = sweep(match, args.runs, seed=args.seed, executor=played, out=args.out, progress=bar.show)
    except KeyboardInterrupt:
        if args.out is not None and args.out.exists():  # otherwise no match was finished
            print(f"what was played is in {args.out}: the same command continues from there", file=sys.stderr)
        raise
    print_report(match, rows, args.seed, args.given, args.table)
    if args.out is not None:
        print(f"\nevery match: {args.out}")
    return 0


def one(args: argparse.Namespace) -> int:
    """Play one match of a sweep again, and record it with `--record`. Returns exit status 0. Raises
    ConfigError."""
    if not 0 <= args.only < args.runs:
        last = f"0 to {args.runs - 1}" if args.runs > 1 else "0"
        raise ConfigError(f"--only {args.only}: the sweep has {args.runs} matches (--runs), number {last}")
    if args.record is not None:
        check_recording(args.record)
    match = match_of(args)
    if not args.any_end:
        match = with_nominal_end(match)
    print_row(play(match, args.only, seed_of(args.seed, args.only), args.record))
    if args.record is None:
        return 0
    file = existing_recording(args.record)
    if file is None:
        raise ConfigError(f"--record {args.record}: nothing was recorded")
    print(f"recorded: {file}")
    return 0


def match_of(args: argparse.Namespace) -> Match:
    """The match that the arguments describe, which may end anywhere. Raises ConfigError,
    FileNotFoundError."""
    _check_numbers(args)
    robot = load_robot(args.robot)
    model = None if args.model is None else _model(args, robot)
    x, y, degrees = args.start
    match = Match(
        Program.read(args.program),
        robot,
        _factors(args, robot, model),
        chain=_chain(args, model),
        imu_rate_hz=200.0 if args.plain_sensors else FIRMWARE_IMU_HZ,
        world=None if args.table is None else World.from_file(args.table),
        start=(x, y, math.radians(degrees)),
        within=DEFAULT_WITHIN if args.within is None else args.within,
        within_angle=math.radians(DEFAULT_WITHIN_DEGREES if args.within_angle is None else args.within_angle),
        seconds=args.seconds,
        model=model,
    )
    if not match.factors:
        raise ConfigError("nothing is varied: leave out --only-varied, or give --vary")
    return match


def _model(args: argparse.Namespace, robot: RobotConfig) -> Parameters:
    """The robot of `--model`, with the tophats of robot.toml added."""
    model = load_model(args.model, robot)
    return replace(model, robot=replace(model.robot, tophats={**model.robot.tophats, **robot.tophats}))


def _chain(args: argparse.Namespace, model: Parameters | None) -> Chain:
    """The sensor chain: the plain one with `--plain-sensors`, else that of the model, or the firmware's if
    there is none."""
    if args.plain_sensors:
        return Chain()
    return Chain.firmware() if model is None or model.chain == Chain() else model.chain


def _check_numbers(args: argparse.Namespace) -> None:
    """Raise ConfigError for numbers out of range, in terms of the command's options and their units."""
    if not args.seconds > 0.0:
        raise ConfigError(f"--seconds {args.seconds:g}: allowed are numbers above 0")
    ends = (
        ("within", args.within, 1.0, "m; 3 cm are 0.03"),
        ("within-angle", args.within_angle, 180.0, "deg"),
    )
    for name, value, most, unit in ends:
        if value is None:
            continue
        if args.any_end:
            raise ConfigError(f"--{name} {value:g}: with --any-end no end counts; leave one of them out")
        if not 0.0 < value <= most:
            allowed = f"numbers above 0 up to {most:g} ({unit}; --any-end: the end does not count)"
            raise ConfigError(f"--{name} {value:g}: allowed are {allowed}")
    check_crew(args)
    check_seed(args.seed)
    check_start(args.start)
    if not 0.0 <= args.faults <= 1.0:
        raise ConfigError(f"--faults {args.faults:g}: allowed are numbers from 0 to 1")


def _factors(args: argparse.Namespace, robot: RobotConfig, model: Parameters | None) -> tuple[Factor, ...]:
    usual = default_factors(robot) if model is None else factors_of_model(robot, model)
    usual = () if args.only_varied else usual
    given = [parse_factor(text) for text in args.vary]
    if args.faults:
        usual = (*usual, *fault_factors(args.faults))
    own = {place_of(robot, each) for each in given}
    # A factor for both sides replaces those of single sides.
    everywhere = {(each.effect, each.parameter) for each in given if each.where is None}
    kept = [
        each
        for each in usual
        if place_of(robot, each) not in own and (each.effect, each.parameter) not in everywhere
    ]
    return (*kept, *given)
