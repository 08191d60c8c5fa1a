"""How much evidence a cause must have to be named."""

from __future__ import annotations

EVIDENCE_GATE = 8.0
FLOOR_GATE = 15.0
"""For what a real floor imitates in ways that no noise model holds: it differs by direction and by wheel."""
FLOOR_LIKE = ("drive.slope", "friction.direction_dependent", "friction.coulomb@", "friction.viscous@")


def gate(name: str) -> float:
    """Log evidence from which a cause is named."""
    return FLOOR_GATE if name.startswith(FLOOR_LIKE) else EVIDENCE_GATE
