"""Recordings: written during a drive, read from files, and replayed through a port."""
