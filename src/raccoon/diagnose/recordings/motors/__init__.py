"""Recordings of single motors and of one power step."""
