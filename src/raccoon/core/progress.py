"""Progress reports of long computations: on a controller a diagnosis takes minutes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

REPORT_PERIOD_CYCLES = 2000
"""Number of a recording's cycles between two reports."""
_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


@contextmanager
def report_to(by: Callable[[str], None]) -> Iterator[None]:
    """Inside, `by` is called with a short text whenever a long computation in this thread proceeds."""
    token = _listener.set(by)
    try:
        yield
    finally:
        _listener.reset(token)


def report(doing: str) -> None:
    """Report the next step, if anybody listens."""
    listener = _listener.get()
    if listener is not None:
        listener(doing)
