"""What a match may do, unless another number is given."""

WITHIN, WITHIN_DEGREES = 0.05, 10.0
"""m and degrees from where the nominal robot ends that a match may end."""
SECONDS = 120.0
"""That it may take."""
