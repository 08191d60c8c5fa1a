"""Work on several recordings one after the other: one that cannot be used is reported and does not stop the
others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from raccoon.cli.progress import show_progress
from raccoon.core.errors import RaccoonError
from raccoon.trace.loading import Run, load_run

Result = TypeVar("Result")
BAD_FILE = 2
"""Exit status if a file cannot be used, as for any bad input."""


def replay_each(files: Sequence[Path], work: Callable[[Run], Result]) -> tuple[list[Result], dict[str, str]]:
    """The results of the files that can be used, and for the others the reasons, by file name.

    Raises as `load_run` and `work` if there is only one file.
    """
    found, failed = [], {}
    for path in files:
        try:
            with show_progress():
                run = load_run(path)
            found.append(work(run))
        except (RaccoonError, OSError) as error:
            if len(files) == 1:
                raise
            said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            failed[str(path)] = said.removeprefix(f"{path}: ").removeprefix(f"{path.name}: ")
    return found, failed


def not_replayed_text(name: str, reason: str) -> str:
    """The line that reports a file that cannot be used."""
    return f"{name}: not replayed: {reason}"
