"""What a process that a program forks (multiprocessing does) must not keep of its parent's robot.

A copy of a descriptor keeps a lock held and a lifeline whole after the program that owns them is gone.
"""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Protocol
from weakref import WeakSet


class Owned(Protocol):
    """Something that belongs to the process that opened it alone."""

    def leave(self) -> None:
        """Close this process's copies, and do nothing else: the parent still uses what they are of."""
        ...


_owned: WeakSet[Owned] = WeakSet()


def leave_in_forks(thing: Owned) -> None:
    """From now on, a process that is forked leaves `thing`."""
    _owned.add(thing)


def _leave_owned() -> None:
    for thing in list(_owned):
        with suppress(OSError, ValueError):
            thing.leave()


os.register_at_fork(after_in_child=_leave_owned)
