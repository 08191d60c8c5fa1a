"""Moments of a drive in which something happened that is nobody's fault: they are left out, as gaps are.

A wheel that slips on a pipe for half a second turns the robot by a radian a second that no wheel reads. Taken
for noise it hides a gyro's bias of 0.01 rad/s, which is plain to see at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from raccoon.diagnose.drives.log import Log

DISTURBANCE_S = 0.6
"""s to either side of the worst reading of a moment that are left out."""


def without_disturbances(log: Log, moments: Sequence[float]) -> Log:
    """The log with what is around these times, s, among what is lost, and a note of it; the same log where
    there are none, or too little would be left."""
    spans = [(each - DISTURBANCE_S, each + DISTURBANCE_S) for each in moments]
    freely = log.without_spans(spans) if spans else None
    if freely is None:
        return log
    note = f"{disturbance_note(moments)} Left out, since the simulated robot drives freely"
    return replace(freely, notes=(*log.notes, note))


def disturbance_note(moments: Sequence[float]) -> str:
    """When it was, s, and what it may have been."""
    times = " and ".join(f"{each:.1f}" for each in sorted(moments))
    return (
        f"around {times} s the robot moved as no command and no cause makes it, and nowhere else: a bump, "
        "something that it ran into or over, a hand?"
    )
