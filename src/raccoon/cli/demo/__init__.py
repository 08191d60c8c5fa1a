"""`raccoon demo`: the paper's claims reproduced on simulated robots, open loop and with the library."""

from __future__ import annotations

import argparse
from pathlib import Path

from raccoon.cli.crew import add_workers_option, check_workers

HELP = "the paper's batteries, motors and lights: open loop and with the library, without hardware"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--out", type=Path, default=Path("raccoon-demo"), help="folder for the picture and the trace"
    )
    parser.add_argument(
        "--seed", type=int, default=1, help="seed of all random numbers (default %(default)s)"
    )
    add_workers_option(parser, 2)


def run(args: argparse.Namespace) -> int:
    """Run the demo. Returns 0 if every error with the library is within the promised limits, otherwise 1."""
    from raccoon.cli.demo.show import show
    from raccoon.cli.numba_check import warn_without_numba

    check_workers(args.workers)
    warn_without_numba()
    return show(args.out, args.seed, args.workers)
