"""Recordings: written while driving, read back, and played through a port."""
