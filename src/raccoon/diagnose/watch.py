"""What a diagnosis is doing, for whoever waits for it: on a controller it takes minutes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


@contextmanager
def watched(by: Callable[[str], None]) -> Iterator[None]:
    """Inside, `by` is called with a few words whenever a diagnosis in this thread turns to something else."""
    token = _listener.set(by)
    try:
        yield
    finally:
        _listener.reset(token)


def tell(doing: str) -> None:
    """Say what comes next, if anybody watches."""
    listener = _listener.get()
    if listener is not None:
        listener(doing)
