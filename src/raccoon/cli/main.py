"""Entry point of `raccoon COMMAND ...`. All imports are inside functions, so that Ctrl-C is handled from the
start."""

from __future__ import annotations

import sys

TYPE_CHECKING = False  # as in typing, without importing it
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command. Returns its exit status, 2 for bad input, 130 after Ctrl-C."""
    try:
        from raccoon.cli.commands import run_command

        return run_command(argv)
    except BaseException as error:
        if not _was_interrupted(error):
            raise
        print("raccoon: interrupted", file=sys.stderr)
        return 130


def _was_interrupted(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused the error. Up to Python 3.11, a KeyboardInterrupt in a class body appears as the
    cause of a RuntimeError."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None
