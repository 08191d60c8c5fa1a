"""`raccoon compare-mitigations`: what each remedy for battery and motor differences is worth, measured."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "measure every mitigation against every battery and motor difference, on the simulator"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--robots", type=int, default=20, help="simulated robots a cell of the table")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--markdown", type=Path, metavar="OUT", help="also write the tables as Markdown")
    parser.add_argument("--plot", type=Path, metavar="OUT", help="also draw them (needs matplotlib)")
    parser.add_argument("--condition", action="append", help="only this condition (may be given again)")


def run(args: argparse.Namespace) -> int:
    """Measure and print, with what the paper says held to it. Exit status 0 when it ran."""
    from raccoon.cli.compare_mitigations.measure import measured
    from raccoon.cli.compare_mitigations.robots import CONDITIONS
    from raccoon.cli.compare_mitigations.table import draw, markdown
    from raccoon.core.errors import ConfigError

    if args.robots < 1:
        raise ConfigError(f"--robots is {args.robots}: it must be 1 or more")
    wanted = tuple(args.condition or CONDITIONS)
    for name in wanted:
        if name not in CONDITIONS:
            raise ConfigError(f"--condition {name}: allowed are {', '.join(CONDITIONS)}")
    cells = measured(wanted, args.robots, args.seed, args.processes)
    text = markdown(cells, wanted, args.robots)
    print(text)
    if args.markdown is not None:
        _write(args.markdown, text)
    if args.plot is not None:
        draw(cells, wanted, args.plot)
    return 0


def _write(path: Path, text: str) -> None:
    import os

    partial = path.with_name(f".{path.name}.{os.getpid()}")
    partial.write_text(text, encoding="utf-8")
    os.replace(partial, path)
