"""Release of the robot's resources in forked processes (of multiprocessing).

A copied descriptor keeps a lock held, and a lifeline intact, after the program that owns them is gone.
"""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Protocol
from weakref import WeakSet


class Owned(Protocol):
    """A resource that belongs only to the process that opened it."""

    def leave(self) -> None:
        """Close this process's copies, and nothing else: the parent still uses the originals."""
        ...


_owned: WeakSet[Owned] = WeakSet()


def leave_in_forks(thing: Owned) -> None:
    """From now on, forked processes call `leave` of `thing`."""
    _owned.add(thing)


def _leave_owned() -> None:
    for thing in list(_owned):
        with suppress(OSError, ValueError):
            thing.leave()


os.register_at_fork(after_in_child=_leave_owned)
