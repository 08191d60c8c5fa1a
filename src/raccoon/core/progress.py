"""What takes long is doing now, for whoever waits for it: on a controller a diagnosis takes minutes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

REPORT_PERIOD_CYCLES = 2000
"""Cycles of a recording after which it is worth a word."""
_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


@contextmanager
def report_to(by: Callable[[str], None]) -> Iterator[None]:
    """Inside, `by` is called with a few words whenever what takes long in this thread goes on."""
    token = _listener.set(by)
    try:
        yield
    finally:
        _listener.reset(token)


def report(doing: str) -> None:
    """Say what comes next, if anybody watches."""
    listener = _listener.get()
    if listener is not None:
        listener(doing)
