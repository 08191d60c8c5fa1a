"""Checks and repairs of a drive's channels: faulty, missing, or with another meaning than their name."""
