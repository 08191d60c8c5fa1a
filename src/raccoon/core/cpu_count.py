"""The number of usable processors."""

from __future__ import annotations

import os


def usable_cores() -> int:
    """Number of processors that this process may use; 1 or more."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
