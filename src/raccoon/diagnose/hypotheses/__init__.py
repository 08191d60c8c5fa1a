"""Possible deviations from the nominal model: coordinates, causes made of them, and base numbers."""
