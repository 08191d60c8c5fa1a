"""Short disturbances of a drive that no fault of the robot causes; they are left out like gaps.

A wheel that slips on a pipe for half a second turns the robot by 1 rad/s that no wheel reads. Counted as
noise, it hides a gyro bias of 0.01 rad/s, which is plain to see at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.diagnose.drives.log import Log

DISTURBANCE_S = 0.6
"""Time, s, that is left out before and after the worst reading of a disturbance."""


def without_disturbances(log: Log, moments: Sequence[float]) -> Log:
    """The log with the time around these moments (s) marked as lost, and a note; the same log if there are no
    moments or too little would remain."""
    spans = [(each - DISTURBANCE_S, each + DISTURBANCE_S) for each in moments]
    freely = log.without_spans(spans) if spans else None
    if freely is None:
        return log
    note = f"{disturbance_note(moments)} Left out, since the simulated robot drives freely"
    return replace(freely, notes=(*log.notes, note))


def disturbance_note(moments: Sequence[float]) -> str:
    """Note on the times of the disturbances (s) and what they may have been."""
    times = " and ".join(f"{each:.1f}" for each in sorted(moments))
    return (
        f"around {times} s, and only then, the robot moved as no command and no cause explains: a bump, "
        "something that it ran into or over, a hand?"
    )
