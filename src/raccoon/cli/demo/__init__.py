"""`raccoon demo`: the paper's claims on simulated robots, and what the library leaves of them."""

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
    parser.add_argument("--seed", type=int, default=1, help="of everything random (default %(default)s)")
    add_workers_option(parser, 2)


def run(args: argparse.Namespace) -> int:
    """Run it; 0 when every error with the library is within the promised limits."""
    from raccoon.cli.demo.show import show
    from raccoon.cli.numba_check import warn_without_numba

    check_workers(args.workers)
    warn_without_numba()
    return show(args.out, args.seed, args.workers)
