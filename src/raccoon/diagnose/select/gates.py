"""How much evidence a cause must have to be named."""

from __future__ import annotations

EVIDENCE_GATE = 8.0
FLOOR_GATE = 15.0
"""For what a real floor imitates in ways that no noise model holds: it differs by direction and by wheel."""
SLOPE_GATE = 11.0
"""A floor imitates it less well than it does those: the robot turns on it."""
FLOOR_LIKE = ("friction.direction_dependent", "friction.coulomb@", "friction.viscous@")


def gate(name: str) -> float:
    """Log evidence from which a cause is named."""
    if name.startswith(FLOOR_LIKE):
        return FLOOR_GATE
    if name == "drive.slope":
        return SLOPE_GATE
    return EVIDENCE_GATE
