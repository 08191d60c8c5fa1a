"""Calls for workers, some of which take their process down. Each worker imports this: it must be quick."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path


def squared(number: int) -> int:
    return number * number


def kills_its_worker_once(marks: str, number: int) -> int:
    """The square; but the first call with 3 kills its process."""
    mark = Path(marks) / "killed"
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(number)


def always_kills_its_worker(number: int) -> int:
    """The square; but every call with 2 kills its process."""
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(number)


def sleeps_for_long(mark: str) -> None:
    """Longer than anybody waits; `mark` is there once it has begun."""
    Path(mark).touch()
    time.sleep(60.0)


def leaves_a_thread(number: int) -> int:
    """The number; what it began goes on for longer than anybody waits."""
    threading.Thread(target=time.sleep, args=(60.0,)).start()
    return number
