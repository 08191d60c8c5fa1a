"""The simulated robot behind a port."""
