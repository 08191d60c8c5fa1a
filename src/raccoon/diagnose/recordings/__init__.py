"""Kinds of recordings, the checks and repairs of their columns, and the diagnosis of each kind."""
