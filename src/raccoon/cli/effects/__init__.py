"""`raccoon effects`: list the effects by which a robot can differ from the nominal one."""

from __future__ import annotations

import argparse
from pathlib import Path

from raccoon.core.errors import ConfigError

HELP = "list the effects the simulated robot knows, or write their page"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("id", nargs="?", help="an effect's id, or a group such as friction")
    parser.add_argument("--json", action="store_true", help="as JSON")
    parser.add_argument(
        "--write",
        type=Path,
        metavar="FOLDER",
        help="write effects.md and its pictures there (needs matplotlib)",
    )


def run(args: argparse.Namespace) -> int:
    """Print the catalogue or a part of it, or write its page. Returns exit status 0. Raises ConfigError."""
    from raccoon.cli.effects.listing import json_text, select_effects, table_text

    if args.write is not None:
        for what, given in ((args.id, args.id is not None), ("--json", args.json)):
            if given:
                raise ConfigError(
                    f"--write {args.write}: it writes the page of all effects; leave out {what}"
                )
        from raccoon.cli.effects.page import write_page
        from raccoon.cli.outputs import check_matplotlib

        check_matplotlib()
        count = write_page(args.write)
        print(f"wrote {args.write / 'effects.md'} and {count} pictures")
        return 0
    entries = select_effects(args.id)
    print(json_text(entries) if args.json else table_text(entries))
    return 0
