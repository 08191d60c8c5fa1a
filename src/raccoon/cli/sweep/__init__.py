"""`raccoon sweep`: play a team's program on hundreds of simulated robots with different batteries, lights and
floors."""

from __future__ import annotations

import argparse
from pathlib import Path

from raccoon.cli.crew import add_crew_options
from raccoon.cli.shared_options import add_place_options
from raccoon.sweep.limits import DEFAULT_MATCH_S, DEFAULT_WITHIN, DEFAULT_WITHIN_DEGREES

HELP = "play a program many times on simulated robots that differ: how often it fails, and why"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("program", type=Path, help="a Python file that defines mission(robot)")
    parser.add_argument("--runs", type=int, default=200, help="matches to play (%(default)s)")
    parser.add_argument("--robot", type=Path, default=Path("robot.toml"), help="the robot (%(default)s)")
    parser.add_argument(
        "--model", type=Path, help="model.toml of the simulated robot; the program still uses robot.toml"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of all random numbers (%(default)s)")
    parser.add_argument(
        "--out",
        type=Path,
        help="table of all matches, .csv or .parquet; an interrupted sweep continues from it",
    )
    add_crew_options(parser, 0)
    _configure_matches(parser)
    parser.add_argument("--only", type=int, metavar="RUN", help="play only this match of the sweep")
    parser.add_argument("--record", type=Path, help="with --only: recording to write")


def _configure_matches(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="EFFECT[.PARAMETER][@WHERE]=RANGE",
        help="LOW:HIGH, MEAN~SD or a number, instead of what is varied by default",
    )
    parser.add_argument("--only-varied", action="store_true", help="vary nothing but what --vary names")
    parser.add_argument(
        "--faults", type=float, default=0.0, help="share of matches with each fault (%(default)g)"
    )
    parser.add_argument(
        "--plain-sensors",
        action="store_true",
        help="simulate robot.toml's plain filter and an IMU at 200 Hz, not RaccoonOS' sensor chain",
    )
    add_place_options(parser)
    parser.add_argument(
        "--within", type=float, help=f"largest distance from the nominal robot's end, m ({DEFAULT_WITHIN:g})"
    )
    parser.add_argument(
        "--within-angle",
        type=float,
        help=f"largest difference from its heading, deg ({DEFAULT_WITHIN_DEGREES:g})",
    )
    parser.add_argument("--any-end", action="store_true", help="a match may end anywhere")
    parser.add_argument(
        "--seconds", type=float, default=DEFAULT_MATCH_S, help="longest duration of a match, s (%(default)g)"
    )


def run(args: argparse.Namespace) -> int:
    """Play the matches and print the results. Returns exit status 0 once they are played, however they end.
    Raises ConfigError."""
    from raccoon.cli.numba_check import warn_without_numba
    from raccoon.cli.sweep.play import one, sweep_and_print

    warn_without_numba()
    return one(args) if args.only is not None else sweep_and_print(args)
