"""Real devices behind a port."""
