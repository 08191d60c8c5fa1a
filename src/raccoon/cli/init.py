"""`raccoon init`: write a robot.toml to start from."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from raccoon.cli.outputs import check_folders
from raccoon.core.errors import ConfigError
from raccoon.core.files import naming_path

HELP = "write a robot.toml with every key, its default and its meaning"


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("path", type=Path, nargs="?", default=Path("robot.toml"), help="where; - prints it")


def run(args: argparse.Namespace) -> int:
    """Write the file, or print it for the path `-`. Raises ConfigError if the file exists: it is never
    overwritten."""
    from raccoon.core.config import template

    path: Path = args.path
    if str(path) == "-":
        sys.stdout.write(template())
        return 0
    if path.exists():
        raise ConfigError(f"{path} exists and is left as it is: name another file")
    check_folders(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    with naming_path(path):
        try:
            partial.write_text(template(), encoding="utf-8")
            os.link(partial, path)  # unlike a rename, this fails if the file has appeared meanwhile
        finally:
            partial.unlink(missing_ok=True)
    print(f"wrote {path}: remove the # from the lines that your robot needs or that you change")
    print(
        "on a computer without a controller `raccoon simulate PROGRAM` runs a program on the simulated "
        'robot; so does port = "sim" under [controller]'
    )
    return 0
