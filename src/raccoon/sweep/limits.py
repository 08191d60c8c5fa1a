"""Default limits of a match."""

DEFAULT_WITHIN, DEFAULT_WITHIN_DEGREES = 0.05, 10.0
"""m and degrees by which a match may end off the nominal robot's end."""
DEFAULT_MATCH_S = 120.0
"""s that a match may take."""
