"""`raccoon compare-mitigations`: measure what each remedy for differences of battery and motors is worth."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.crew import add_workers_option, check_workers
from raccoon.cli.outputs import check_folders, check_matplotlib, check_replaceable
from raccoon.cli.shared_options import check_seed
from raccoon.core.errors import ConfigError
from raccoon.core.files import write_atomically
from raccoon.core.near_names import did_you_mean
from raccoon.core.progress import report

if TYPE_CHECKING:
    from collections.abc import Callable

    from raccoon.cli.compare_mitigations.measure import Ends, Number

HELP = "measure every mitigation against every battery and motor difference, on the simulator"
QUICK = 2
PICTURES = (".svg", ".png", ".pdf")


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--quick",
        action="store_true",
        help=f"{QUICK} robots per column: takes a minute and shows the worst of {QUICK}",
    )
    parser.add_argument(
        "--robots", type=int, help="simulated robots per column (default: the full table, 24 to 200)"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of all random numbers (%(default)s)")
    add_workers_option(parser, 1)
    parser.add_argument(
        "--tape",
        type=float,
        default=0.001,
        help="m, standard deviation of the tape measure of all calibrations (%(default)g)",
    )
    parser.add_argument("--condition", action="append", help="only this column (repeatable)")
    parser.add_argument("--markdown", type=Path, metavar="OUT", help="also write the tables as Markdown")
    parser.add_argument("--plot", type=Path, metavar="OUT", help="also draw them (needs matplotlib)")
    parser.add_argument(
        "--results",
        type=Path,
        metavar="FILE",
        help="keep every robot's errors there, one line each; robots that are in it are not driven again",
    )


def run(args: argparse.Namespace) -> int:
    """Measure all mitigations and print the tables, with the paper's claims compared. Returns exit status 0.
    Raises ConfigError."""
    from raccoon.cli.compare_mitigations.measure import group_by_cell, measure_all
    from raccoon.cli.compare_mitigations.results import stored
    from raccoon.cli.compare_mitigations.table import draw, markdown
    from raccoon.cli.numba_check import warn_without_numba
    from raccoon.cli.progress import show_progress

    check_seed(args.seed)
    check_folders(args.markdown, args.plot, args.results)
    check_replaceable(args.markdown)
    if args.plot is not None and args.plot.suffix not in PICTURES:
        raise ConfigError(f"--plot {args.plot}: allowed are the endings {', '.join(PICTURES)}")
    if args.plot is not None:
        check_matplotlib()
    robots = _robots(args)
    warn_without_numba()
    known = {} if args.results is None else stored(args.results, args.seed, args.tape)
    done = _note(args, sum(robots.values()))
    with show_progress():
        report("driving the first robots")
        found = measure_all(robots, args.seed, args.workers, tape_std=args.tape, known=known, done=done)
    cells = group_by_cell(found)
    text = markdown(cells, robots)
    try:  # files first: a closed pipe ends the command when it prints
        if args.markdown is not None:
            write_atomically(args.markdown, text)
        if args.plot is not None:
            draw(cells, tuple(robots), args.plot)
    finally:
        print(text)
    return 0


def _note(args: argparse.Namespace, every: int) -> Callable[[Number, dict[str, Ends]], None]:
    """The function to call for each robot that was driven: it stores the result and reports progress. every:
    robots in all."""
    import sys

    from raccoon.cli.compare_mitigations.results import writer

    store = (
        (lambda _robot, _ends: None) if args.results is None else writer(args.results, args.seed, args.tape)
    )
    count = 0

    def done(robot: Number, ends: dict[str, Ends]) -> None:
        nonlocal count
        count += 1
        store(robot, ends)
        far = f"{count} robots driven, of {every} in the table"
        report(far)
        if count % 20 == 0 and not sys.stderr.isatty():
            print(far, file=sys.stderr)

    return done


def _robots(args: argparse.Namespace) -> dict[str, int]:
    """Number of robots of each requested column. Raises ConfigError."""
    from raccoon.cli.compare_mitigations.robots import CONDITIONS

    if args.robots is not None and args.quick:
        raise ConfigError(f"--robots {args.robots}: --quick means {QUICK}; leave one of them out")
    if args.robots is not None and args.robots < 1:
        raise ConfigError(f"--robots {args.robots}: allowed are whole numbers from 1")
    check_workers(args.workers)
    if not 0.0 <= args.tape < 0.1:
        raise ConfigError(f"--tape {args.tape:g}: allowed are numbers from 0 to 0.1 (m)")
    full = {name: condition.robots for name, condition in CONDITIONS.items()}
    for name in args.condition or ():
        if name not in full:
            raise ConfigError(f"--condition {name}{did_you_mean(name, full)}: allowed are {', '.join(full)}")
    every = args.robots or (QUICK if args.quick else None)
    return {name: every or count for name, count in full.items() if name in (args.condition or full)}
