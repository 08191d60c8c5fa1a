"""How much evidence a cause must have to be named."""

from __future__ import annotations

from raccoon.diagnose.hypotheses import by_name

EVIDENCE_GATE = 8.0
FLOOR_GATE = 15.0
"""For what a real floor imitates in ways that no noise model holds: it differs by direction."""
WHEEL_GATE = 20.0
"""For what holds back one wheel only, which it imitates best: a patch under one side."""
SLOPE_GATE = 11.0
"""A floor imitates it less well than it does those: the robot turns on it."""
SCALE_GATE = 11.0
"""One reading's scale differs from the other's as wheels and motors do that are far out in robot.toml."""
_ONE_WHEEL = ("friction.", "actuation.deadband")
_GATES = {
    "friction.direction_dependent": FLOOR_GATE,
    "drive.slope": SLOPE_GATE,
    "bemf.scale@": SCALE_GATE,
}


def gate(name: str) -> float:
    """Log evidence from which a cause is named."""
    if "@" in name and name.startswith(_ONE_WHEEL):
        return WHEEL_GATE
    return by_name(_GATES, name, EVIDENCE_GATE)
