"""`raccoon convert`: convert a recording to another format."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.outputs import check_folders, check_not_read
from raccoon.core.errors import ConfigError

if TYPE_CHECKING:
    from raccoon.trace.loading import Run

HELP = "convert a recording to CSV or MCAP, also one of other software that raccoon can read"
ENDINGS = (".csv", ".mcap")


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "source",
        type=Path,
        help="a trace, a CSV or MCAP file, or a recording of other software that raccoon can read",
    )
    parser.add_argument("target", type=Path, help="file to write; its ending (.csv, .mcap) sets the format")
    parser.add_argument("--overwrite", action="store_true", help="replace the target if it exists")


def run(args: argparse.Namespace) -> int:
    """Convert one recording and print the problems found in it. Returns exit status 0."""
    from raccoon.cli.progress import show_progress
    from raccoon.trace.loading import load_run
    from raccoon.trace.problems import without_repeats
    from raccoon.trace.record import recording_file

    source: Path = args.source
    target: Path = args.target
    if target.suffix not in ENDINGS:
        raise ConfigError(f"{target}: allowed are the endings {', '.join(ENDINGS)}")
    if target.exists() and not args.overwrite:
        raise ConfigError(f"{target} exists and is left as it is: name another file or add --overwrite")
    check_folders(target)
    check_not_read([target], [recording_file(source)])  # else the only copy would lose its doubtful values
    with show_progress():
        loaded = load_run(source)
    _write(loaded, target)
    for problem in without_repeats(loaded.recording.problems):
        print(f"note: {problem}")
    print(f"wrote {target}: {len(loaded.recording)} rows of {len(loaded.recording.columns)} columns")
    return 0


def _write(loaded: Run, target: Path) -> None:
    if target.suffix == ".mcap":
        from raccoon.trace.mcap import write_mcap

        write_mcap(loaded.recording, target)
        return
    from raccoon.trace.csv import write_csv

    write_csv(loaded.recording, target)
