"""Actions that a program makes as a statement of its own, and that nothing does: a forgotten `run`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType

Place = tuple[str, int]
_settled: set[Place] = set()
"""Lines of programs of whose actions one was begun, or of which it was said: at most all of them."""


class Undone:
    """What is made to be done. Where it is the whole of a statement, dropped before it was begun, the log
    says so once a line; what is kept, chosen from, or a part of something else may never come to its turn.
    """

    name: str

    def __init__(self) -> None:
        self._made = _place(_program())

    def begun(self) -> None:
        """It is done now."""
        if self._made is not None:
            _settled.add(self._made)

    def __del__(self, over: Callable[[], bool] = sys.is_finalizing) -> None:
        if over():  # then the names of this module are gone, too
            return
        made: Place | None = getattr(self, "_made", None)
        if made is None or made in _settled:
            return
        program = _program()
        if made != _place(program) or not _ends_a_statement(program):
            return
        _settled.add(made)
        import logging

        logging.getLogger("raccoon").warning(
            "%s, line %d: %r is made and not done: write robot.run(...) around it", *made, self.name
        )


def _program() -> FrameType | None:
    """The frame of the program that is at work, behind all of the library's own."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").startswith("raccoon."):
        frame = frame.f_back
    return frame


def _place(frame: FrameType | None) -> Place | None:
    return None if frame is None else (frame.f_code.co_filename, frame.f_lineno)


def _ends_a_statement(frame: FrameType | None) -> bool:
    """Whether it drops the value of an expression that is a statement just now."""
    from opcode import opmap

    return frame is not None and frame.f_code.co_code[frame.f_lasti] == opmap["POP_TOP"]
