"""Programs that tests start."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def default_signals(*numbers: signal.Signals) -> Iterator[None]:
    """This process, and children that are started meanwhile, heed these signals.

    nohup ignores SIGHUP and a shell's background job SIGINT, and their children inherit that: what a test
    sends would then end nothing.
    """
    before = [signal.signal(number, signal.SIG_DFL) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
