"""Detects actions that a program makes as a statement of its own and never runs: a forgotten `run`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType

Place = tuple[str, int]
_checked_places: set[Place] = set()
"""Lines of programs whose action was run once, or was reported: all of them at most."""


class MustRun:
    """Base of what must be run. If it is the whole of a statement and is dropped before it was run, the log
    reports it, once for each line. What is stored, chosen from, or part of something else need not run."""

    name: str

    def __init__(self) -> None:
        self._made_at = _place_of_frame(_program_frame())

    def mark_run(self) -> None:
        """Note that it is being run."""
        if self._made_at is not None:
            _checked_places.add(self._made_at)

    def __del__(self, over: Callable[[], bool] = sys.is_finalizing) -> None:
        if over():  # then the names of this module are gone, too
            return
        made: Place | None = getattr(self, "_made_at", None)
        if made is None or made in _checked_places:
            return
        program = _program_frame()
        if made != _place_of_frame(program) or not _drops_value(program):
            return
        _checked_places.add(made)
        import logging

        logging.getLogger("raccoon").warning(
            "%s, line %d: %r is created but never run: write robot.run(...) around it", *made, self.name
        )


def _program_frame() -> FrameType | None:
    """The frame of the program that is running, below all frames of the library."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").startswith("raccoon."):
        frame = frame.f_back
    return frame


def _place_of_frame(frame: FrameType | None) -> Place | None:
    return None if frame is None else (frame.f_code.co_filename, frame.f_lineno)


def _drops_value(frame: FrameType | None) -> bool:
    """Whether the frame is just dropping the value of an expression statement."""
    from opcode import opmap

    return frame is not None and frame.f_code.co_code[frame.f_lasti] == opmap["POP_TOP"]
