"""Recordings of single motors, and of one motor's response to a step of power."""
