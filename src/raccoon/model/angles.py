"""Angles in radians: wrapping, the shortest difference, and the turn nearest to another angle."""

from __future__ import annotations

import math

TURN = 2.0 * math.pi


def wrapped(angle: float) -> float:
    """The same direction in [-pi, pi).

    Raises ValueError for an angle that is not finite.
    """
    if not math.isfinite(angle):
        raise ValueError(f"angle is {angle}: it must be finite")
    result = math.fmod(angle + math.pi, TURN)
    if result < 0.0:
        result += TURN
    # fmod of a tiny negative number plus a turn rounds up to the turn itself.
    return result - math.pi if result < TURN else -math.pi


def difference(target: float, origin: float) -> float:
    """Shortest turn from `origin` to `target`, in [-pi, pi); counter-clockwise positive."""
    return wrapped(target - origin)
