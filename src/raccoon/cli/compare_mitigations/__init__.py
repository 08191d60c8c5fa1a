"""`raccoon compare-mitigations`: what each remedy for battery and motor differences is worth, measured."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from raccoon.cli.compare_mitigations.measure import Cells

HELP = "measure every mitigation against every battery and motor difference, on the simulator"
QUICK = 2


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--quick", action="store_true", help=f"{QUICK} robots a column: a minute, and the worst of {QUICK}"
    )
    parser.add_argument(
        "--robots", type=int, help="simulated robots a column (without it the full table, 24 to 200)"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--condition", action="append", help="only this column (may be given again)")
    parser.add_argument("--markdown", type=Path, metavar="OUT", help="also write the tables as Markdown")
    parser.add_argument("--plot", type=Path, metavar="OUT", help="also draw them (needs matplotlib)")
    parser.add_argument("--json", type=Path, metavar="OUT", help="also write every robot's errors")


def run(args: argparse.Namespace) -> int:
    """Measure and print, with what the paper says held to it. Exit status 0 when it ran."""
    import sys

    from raccoon.cli.compare_mitigations.measure import measured
    from raccoon.cli.compare_mitigations.table import markdown

    robots = _robots(args)
    cells = measured(robots, args.seed, args.processes, lambda said: print(said, file=sys.stderr))
    text = markdown(cells, robots)
    print(text)
    _save(args, cells, tuple(robots), text)
    return 0


def _robots(args: argparse.Namespace) -> dict[str, int]:
    """Robots of each column that is wanted. Raises ConfigError."""
    from raccoon.cli.compare_mitigations.measure import full_table
    from raccoon.core.errors import ConfigError

    if args.robots is not None and args.robots < 1:
        raise ConfigError(f"--robots is {args.robots}: it must be 1 or more")
    if args.processes < 1:
        raise ConfigError(f"--processes is {args.processes}: it must be 1 or more")
    full = full_table()
    for name in args.condition or ():
        if name not in full:
            raise ConfigError(f"--condition {name}: allowed are {', '.join(full)}")
    every = args.robots or (QUICK if args.quick else None)
    return {name: every or count for name, count in full.items() if name in (args.condition or full)}


def _save(args: argparse.Namespace, cells: Cells, conditions: tuple[str, ...], text: str) -> None:
    from raccoon.cli.compare_mitigations.table import as_json, draw

    if args.markdown is not None:
        _write(args.markdown, text)
    if args.json is not None:
        _write(args.json, as_json(cells))
    if args.plot is not None:
        draw(cells, conditions, args.plot)


def _write(path: Path, text: str) -> None:
    import os

    partial = path.with_name(f".{path.name}.{os.getpid()}")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, path)
