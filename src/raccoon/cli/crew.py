"""Options for where a command does its many runs: in how many processes, or on the workers of a Dask
scheduler."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from raccoon.core.errors import ConfigError

if TYPE_CHECKING:
    from raccoon.sweep.execute import Crew


def add_workers_option(parser: argparse.ArgumentParser, usual: int) -> None:
    """Add the option `--workers`. usual: its default; 0 means one process per core."""
    parser.add_argument(
        "--workers",
        type=int,
        default=usual,
        help="processes to use; 0: one per core (default %(default)s)",
    )


def add_crew_options(parser: argparse.ArgumentParser, usual: int) -> None:
    """Add the options of commands whose workers may run elsewhere. usual: default of `--workers`."""
    add_workers_option(parser, usual)
    parser.add_argument(
        "--executor",
        choices=("processes", "dask"),
        default="processes",
        help="where the workers run (processes of this computer)",
    )
    parser.add_argument(
        "--scheduler", help="with --executor dask: address of its scheduler (default: start one here)"
    )


def check_workers(workers: int) -> None:
    """Raise ConfigError for a negative `--workers`."""
    if workers < 0:
        raise ConfigError(f"--workers {workers}: allowed are whole numbers from 0")


def check_crew(args: argparse.Namespace) -> None:
    """Raise ConfigError if the options of `add_crew_options` contradict each other."""
    check_workers(args.workers)
    if args.scheduler is not None and args.executor != "dask":
        raise ConfigError(f"--scheduler {args.scheduler}: it needs --executor dask")


def open_crew(args: argparse.Namespace) -> AbstractContextManager[Crew]:
    """The workers that the options of `add_crew_options` select."""
    from raccoon.sweep.workers import dask_crew, process_crew

    if args.executor == "dask":
        return dask_crew(args.scheduler, args.workers or None)
    return process_crew(args.workers or None)
