"""What a match may do, unless another number is given."""

DEFAULT_WITHIN, DEFAULT_WITHIN_DEGREES = 0.05, 10.0
"""m and degrees from where the nominal robot ends that a match may end."""
DEFAULT_MATCH_S = 120.0
"""That it may take."""
