"""Actions that a program makes as a statement of its own, and that nothing does: a forgotten `run`."""

from __future__ import annotations

import sys
from collections.abc import Callable

Place = tuple[str, int]
_settled: set[Place] = set()
"""Lines of programs of whose actions one was begun, or of which it was said: at most all of them."""


class Undone:
    """What is made to be done. Where it is dropped on the very line that made it, before it was begun, the
    log says so once a line; what is kept, or is a part of something else, may never come to its turn.
    """

    name: str

    def __init__(self) -> None:
        self._made = _line()

    def begun(self) -> None:
        """It is done now."""
        if self._made is not None:
            _settled.add(self._made)

    def __del__(self, over: Callable[[], bool] = sys.is_finalizing) -> None:
        if over():  # then the names of this module are gone, too
            return
        made: Place | None = getattr(self, "_made", None)
        if made is None or made in _settled or made != _line():
            return
        _settled.add(made)
        import logging

        logging.getLogger("raccoon").warning(
            "%s, line %d: %r is made and not done: write robot.run(...) around it", *made, self.name
        )


def _line() -> Place | None:
    """The line of the program that is at work, behind all of the library's own; None where there is none."""
    frame = sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").startswith("raccoon."):
        if frame.f_back is None:
            return None
        frame = frame.f_back
    return frame.f_code.co_filename, frame.f_lineno
