"""Beliefs: readings in; value, uncertainty and status out."""
