"""Tracebacks for teams: an error that ends a program is printed with the program's own lines and its message.

How a motion got from `run` to the line that raises does not help who wrote the program, and hides what does.
So frames of this package are left out of the printed traceback (not of the error) if the error was raised
deliberately, by a `raise`, or by the system for a file that it names. Any other error is a fault of the
package, and all of it is printed.
"""

from __future__ import annotations

import os
import sys
import sysconfig
from pathlib import Path
from types import FrameType, TracebackType

from raccoon.robot.name_hints import add_hints

WHOLE = "RACCOON_TRACEBACK"
"""Environment variable; if it is not empty, everything is printed."""

_PACKAGE = str(Path(__file__).parents[1]) + os.sep
_INSTALLED = tuple(sysconfig.get_paths()[each] + os.sep for each in ("stdlib", "purelib", "platlib"))


def install_hook() -> None:
    """Have errors that end the program printed by `print_error`, unless another hook is installed."""
    if sys.excepthook is sys.__excepthook__ and not os.environ.get(WHOLE):
        sys.excepthook = _print_uncaught


def install_hook_for(frame: FrameType | None) -> None:
    """Do so if a team's program is at `frame`, not a library that uses this one: it owns no hooks."""
    if _is_in_program(frame):
        install_hook()


def _is_in_program(frame: FrameType | None) -> bool:
    """Whether a frame, or what imports something there, is in the file that Python was started with, or in a
    module of its folder or below that is not installed there."""
    while frame is not None and str(frame.f_globals.get("__name__")).startswith("importlib."):
        frame = frame.f_back  # `from raccoon import ...`
    if frame is None or frame.f_globals.get("__name__") == "__main__":
        return frame is not None
    file, started = frame.f_globals.get("__file__"), getattr(sys.modules.get("__main__"), "__file__", None)
    if not file or not started:  # as in an interactive session
        return False
    module = Path(file).absolute()
    return Path(started).absolute().parent in module.parents and "site-packages" not in module.parts


def _print_uncaught(_: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    print_error(error.with_traceback(trace), f"{WHOLE}=1 in the environment")


def print_error(error: BaseException, how: str) -> None:
    """Print an error to stderr as Python does, without the frames of this package. how: what to do to see
    them all."""
    add_hints(error)
    whole, suppressed = error.__traceback__, error.__suppress_context__
    of_a_file = isinstance(error, OSError) and error.filename is not None
    own, hidden = _own_frames(whole, of_a_file or isinstance(error, SyntaxError | KeyboardInterrupt))
    if hidden:
        error.__suppress_context__ = True  # and what led the package to its words
    try:
        sys.__excepthook__(type(error), error.with_traceback(own), own)
    finally:
        error.__traceback__, error.__suppress_context__ = whole, suppressed
    if hidden:
        print(f"(lines of raccoon itself are left out: {how} shows them)", file=sys.stderr)


def _own_frames(trace: TracebackType | None, elsewhere: bool) -> tuple[TracebackType | None, bool]:
    """The frames of the program, and whether any after its first one is left out. All frames if the error was
    raised neither in the program nor deliberately in this package. elsewhere: whether the error did not arise
    in the line that raised it."""
    frames: list[TracebackType] = []
    while trace is not None:
        frames.append(trace)
        trace = trace.tb_next
    own = [each for each in frames if _is_of_program(each)]
    if not elsewhere and not (own and (frames[-1] is own[-1] or _is_in_words(frames[-1]))):
        return (frames[0] if frames else None), False
    kept: TracebackType | None = None
    for each in reversed(own):
        kept = TracebackType(kept, each.tb_frame, each.tb_lasti, each.tb_lineno)
    return kept, bool(own) and len(frames) - frames.index(own[0]) > len(own)


def _is_of_program(step: TracebackType) -> bool:
    file = step.tb_frame.f_code.co_filename
    return not file.startswith((_PACKAGE, *_INSTALLED, "<frozen "))


def _is_in_words(step: TracebackType) -> bool:
    """Whether the frame is at a `raise` of this package."""
    from opcode import opmap

    code = step.tb_frame.f_code
    return code.co_filename.startswith(_PACKAGE) and code.co_code[step.tb_lasti] == opmap["RAISE_VARARGS"]
